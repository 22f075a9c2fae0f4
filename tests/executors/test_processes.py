import errno
import multiprocessing
import multiprocessing.synchronize
import os
import signal
import time
from multiprocessing.util import Finalize
from pathlib import Path

import pytest

from brrp_cli.errors import BrrpError, MeshError
from brrp_cli.executors import processes
from brrp_cli.executors.processes import Processes


def act(what: str) -> str:
    if what == "refuse":
        raise MeshError("Not this one", found="a hole")
    if what == "stumble":
        raise ZeroDivisionError("by zero")
    if what == "die":
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "hang":
        time.sleep(600)
    if what == "threads":
        return os.environ["OMP_NUM_THREADS"]
    return what.upper()


def test_each_task_ends_alone_whatever_becomes_of_it() -> None:
    tasks = [(what,) for what in ("a", "die", "refuse", "b", "hang", "stumble", "threads", "c")]
    results = dict(Processes(2).run(act, tasks, 3.0))
    assert sorted(results) == list(range(8))
    assert [results[i] for i in (0, 3, 6, 7)] == ["A", "B", "1", "C"]
    assert "SIGSEGV" in str(results[1])
    assert isinstance(results[2], MeshError)
    assert results[2].found == "a hole"
    assert results[4].what == "Took too long"
    assert isinstance(results[5], BrrpError)
    assert "ZeroDivisionError" in str(results[5])


def promise(path: Path) -> None:
    """What a process does when it ends by itself, as locks between processes do to be removed."""
    Finalize(None, path.touch, exitpriority=0)


def test_workers_with_nothing_to_do_end_by_themselves(tmp_path: Path) -> None:
    paths = [tmp_path / "a", tmp_path / "b"]
    assert len(list(Processes(2).run(promise, [(path,) for path in paths], 60.0))) == 2
    assert all(path.exists() for path in paths)


def test_closing_early_leaves_no_process() -> None:
    before, others = dict(os.environ), set(multiprocessing.active_children())
    results = Processes(2).run(act, [("a",), ("hang",)], 60.0)
    assert next(results) == (0, "A")
    assert set(multiprocessing.active_children()) - others
    results.close()
    assert set(multiprocessing.active_children()) <= others
    assert dict(os.environ) == before


def test_a_worker_that_is_killed_while_it_has_nothing_to_do_costs_no_task() -> None:
    results = Processes(1).run(act, [("a",), ("b",), ("c",)], 60.0)
    assert next(results) == (0, "A")
    for child in multiprocessing.active_children():
        child.kill()
        child.join()
    time.sleep(0.5)
    assert list(results) == [(1, "B"), (2, "C")]


@pytest.mark.parametrize("program", ["/bin/false", "/no/such/python"])
def test_processes_that_do_not_start_are_told(program, monkeypatch) -> None:
    monkeypatch.setattr(processes, "_START", 1.0)
    others = set(multiprocessing.active_children())
    before = multiprocessing.spawn.get_executable()
    multiprocessing.set_executable(program)
    try:
        with pytest.raises(BrrpError, match="Worker processes cannot start") as told:
            list(Processes(2).run(act, [("a",), ("b",)], 60.0))
    finally:
        multiprocessing.set_executable(before)
    assert "exit code" in str(told.value.found)
    assert set(multiprocessing.active_children()) <= others


def test_a_machine_without_semaphores_is_told(monkeypatch) -> None:
    def refuse(*arguments: object) -> None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(multiprocessing.synchronize._multiprocessing, "SemLock", refuse)
    with pytest.raises(BrrpError, match="Worker processes cannot start"):
        list(Processes(1).run(act, [("a",)], 60.0))
