"""Helpers do what they are asked, tell what went wrong, and cost nothing but time when lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import for_helpers
import pytest

from brrp_cli.errors import BrrpError, PriorError
from brrp_cli.executors import helpers as module
from brrp_cli.executors.helpers import Helpers, LostError

TESTS = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def helpers():
    found = Helpers(1)
    found.start()
    found.wait()
    yield found
    found.close()


def call(helpers, function, *args):
    with helpers.lent() as helper:
        return helper.call(function, *args)


def is_there(pid):
    """Whether a process runs, and has not merely not been asked how it ended."""
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def gone(pid, seconds=20.0):
    end = time.monotonic() + seconds
    while is_there(pid) and time.monotonic() < end:
        time.sleep(0.05)
    return not is_there(pid)


def test_a_helper_works_in_another_process_with_one_thread(helpers):
    assert call(helpers, for_helpers.process) != os.getpid()
    assert call(helpers, for_helpers.threads) == (1, 1)


def test_errors_come_back_as_they_are(helpers):
    with pytest.raises(PriorError) as told:
        call(helpers, for_helpers.fail, "bad prior")
    assert (told.value.where, told.value.found) == ("shard", 3)
    with pytest.raises(ValueError, match="no such value"):
        call(helpers, for_helpers.fail, "value")
    with pytest.raises(BrrpError, match="does not know"):
        call(helpers, for_helpers.fail, "what cannot be sent")
    assert call(helpers, for_helpers.process), "it goes on"


def test_none_is_lent_twice_or_before_it_is_ready(helpers):
    with helpers.lent() as first, helpers.lent() as second:
        assert first is not None and second is None
    fresh = Helpers(1)
    with fresh.lent() as helper:
        assert helper is None
    fresh.start()
    with fresh.lent() as helper:
        assert helper is None, "it takes longer to start than this"
    fresh.close()


def test_ctrl_c_of_the_terminal_is_not_for_it(helpers):
    pid = call(helpers, for_helpers.process)
    os.kill(pid, signal.SIGINT)
    assert call(helpers, for_helpers.process) == pid


def test_one_that_dies_is_replaced_but_not_for_ever(monkeypatch):
    monkeypatch.setattr(module, "MOST_LOST", 1)
    helpers = Helpers(1)
    for lost in range(3):
        helpers.start()
        helpers.wait()
        with helpers.lent() as helper:
            if lost == 2:
                assert helper is None
                break
            with pytest.raises(LostError):
                helper.call(for_helpers.die)
    helpers.close()


def test_one_that_never_starts_is_replaced_but_not_for_ever():
    helpers = Helpers(1, ["no_such_module"])
    for _ in range(module.MOST_LOST + 1):
        helpers.start()
        assert helpers.processes
        helpers.wait()
        assert not helpers.any_ready
    helpers.start()
    assert not helpers.processes


def test_one_that_hangs_is_given_up(monkeypatch):
    monkeypatch.setattr(module, "PATIENCE", 30.0)
    helpers = Helpers(1)
    helpers.start()
    helpers.wait()
    pid = call(helpers, for_helpers.process)
    monkeypatch.setattr(module, "PATIENCE", 0.2)
    with helpers.lent() as helper, pytest.raises(LostError):
        helper.call(for_helpers.sleep, 60.0)
    assert gone(pid) and not helpers.any_ready


def test_they_end_when_they_are_closed():
    helpers = Helpers(1)
    helpers.start()
    helpers.wait()
    pid = call(helpers, for_helpers.process)
    helpers.close()
    assert gone(pid)
    helpers.start()
    assert not helpers.any_ready


@pytest.mark.parametrize("end", ["os.kill(os.getpid(), signal.SIGKILL)", "pass"])
def test_they_end_with_their_process_and_do_not_run_its_script_again(tmp_path, end):
    script = tmp_path / "script.py"
    script.write_text(
        "import os, signal, for_helpers\n"
        "from brrp_cli.executors.helpers import Helpers\n"
        "helpers = Helpers(1)\n"
        "helpers.start()\n"
        "helpers.wait()\n"
        "with helpers.lent() as helper:\n"
        "    print(helper.call(for_helpers.process), flush=True)\n"
        f"{end}\n"
    )
    path = os.pathsep.join([str(TESTS / "support"), *sys.path])
    done = subprocess.run(
        [sys.executable, script],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    (pid,) = done.stdout.split()
    assert gone(int(pid)) and done.stderr == ""


def test_a_system_without_processes_has_no_helpers(monkeypatch):
    def refuse(*_, **__):
        raise BlockingIOError("Resource temporarily unavailable")

    monkeypatch.setattr(module.subprocess, "Popen", refuse)
    helpers = Helpers(2)
    helpers.start()
    helpers.wait()
    with helpers.lent() as helper:
        assert helper is None
    helpers.close()
