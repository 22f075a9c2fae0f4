import json
import logging
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from brrp_cli.cli import COMMANDS, LazyGroup, main, volume_options, with_volume
from brrp_cli.errors import BrrpError
from brrp_cli.version import __version__

HEAVY = ["torch", "open3d", "onnxruntime", "pymeshlab", "trimesh", "scipy", "skimage", "h5py"]


def imported(*arguments: str) -> set[str]:
    """What a fresh interpreter has imported after `brrp ARGUMENTS`."""
    code = (
        "import json, sys\n"
        "from brrp_cli.cli import main\n"
        f"main({list(arguments)!r}, standalone_mode=False)\n"
        "print('MODULES' + json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.rpartition("MODULES")[2]))


def test_help_lists_every_command() -> None:
    done = CliRunner().invoke(main, ["--help"])
    assert done.exit_code == 0
    for name, (_, text) in COMMANDS.items():
        assert re.search(rf"^  {name}\s+{re.escape(text[:20])}", done.output, re.MULTILINE)


def test_help_imports_nothing_heavy() -> None:
    assert not imported("--help") & {*HEAVY, "numpy"}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_with_an_example(name: str) -> None:
    done = CliRunner().invoke(main, [name, "--help"])
    assert done.exit_code == 0, done.output
    assert "Example" in done.output
    assert f"brrp {name}" in done.output


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command_imports_nothing_heavy(name: str) -> None:
    assert not imported(name, "--help") & set(HEAVY)


def test_version_of_the_installed_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "brrp_cli", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"brrp, version {__version__}\n"


def test_an_unknown_command_is_a_usage_error() -> None:
    done = CliRunner().invoke(main, ["recontsruct"])
    assert done.exit_code == 2
    assert "No such command 'recontsruct'. Did you mean 'reconstruct'?" in done.stderr
    assert "Did you mean" not in CliRunner().invoke(main, ["xyz"]).stderr


class Failing(LazyGroup):
    """The group of `brrp` with one command, which fails as `error` says."""

    error: Exception

    def get_command(self, ctx: click.Context, name: str) -> click.Command:
        def fail() -> None:
            logging.getLogger("brrp_cli.tests").debug("on the way")
            raise self.error

        return with_volume(click.Command(name, callback=fail))


def fail_with(error: Exception, *arguments: str) -> click.testing.Result:
    group = Failing("brrp", params=volume_options())
    group.error = error
    with stderr_log():
        return CliRunner().invoke(group, arguments or ["anything"])


@contextmanager
def stderr_log() -> Iterator[None]:
    """Handlers of the log that a process of its own would have: none yet."""
    root = logging.getLogger()
    before, root.handlers = root.handlers, []
    try:
        yield
    finally:
        root.handlers = before


def test_a_brrp_error_is_one_message_without_traceback() -> None:
    done = fail_with(BrrpError("The frame has no depth", where="a.npz", fix="add depth"))
    assert done.exit_code == 1
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        "Error: The frame has no depth",
        "  where:    a.npz",
        "  fix:      add depth",
    ]


def test_a_brrp_error_brings_its_exit_code() -> None:
    error = BrrpError("Some objects failed")
    error.exit_code = 3
    assert fail_with(error).exit_code == 3


def test_any_other_exception_is_told_and_says_how_to_see_its_traceback() -> None:
    done = fail_with(ZeroDivisionError("ours"))
    assert done.exit_code == 1 and "Traceback" not in done.stderr
    assert "found:    ZeroDivisionError('ours')" in done.stderr
    assert "test_cli.py" in done.stderr and "run again with --verbose" in done.stderr


@pytest.mark.parametrize("arguments", [["-v", "anything"], ["anything", "--verbose"]])
def test_verbose_shows_the_traceback_and_the_log(arguments: list[str]) -> None:
    done = fail_with(ZeroDivisionError("ours"), *arguments)
    assert done.exit_code == 1
    assert "Traceback (most recent call last)" in done.stderr
    assert "DEBUG brrp_cli.tests: on the way" in done.stderr
    assert "DEBUG" not in fail_with(ZeroDivisionError("ours")).stderr


def test_mistyped_options_are_told_with_the_one_that_was_meant() -> None:
    done = CliRunner().invoke(main, ["info", "--jsn"])
    assert done.exit_code == 2 and "--json" in done.stderr


def test_version_is_short_too() -> None:
    assert CliRunner().invoke(main, ["-V"]).output == f"brrp, version {__version__}\n"


def test_quiet_leaves_results_and_errors_alone(tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.ply")
    arguments = ["build-prior", str(tmp_path), "--samples", "100", "-o"]
    loud = CliRunner().invoke(main, [*arguments, str(tmp_path / "loud")])
    quiet = CliRunner().invoke(main, ["-q", *arguments, str(tmp_path / "quiet")])
    after = CliRunner().invoke(main, [*arguments, str(tmp_path / "quiet"), "--quiet"])
    both = CliRunner().invoke(main, ["-q", *arguments, str(tmp_path / "both"), "-v"])
    assert both.exit_code == 2 and "exclude each other" in both.stderr
    assert "Prior:" in loud.stderr
    assert quiet.stderr == after.stderr == ""
    assert quiet.stdout.startswith("1 object (1 made")
    failed = CliRunner().invoke(main, ["-q", "info", str(tmp_path / "nothing")])
    assert failed.exit_code == 1 and "Error:" in failed.stderr
