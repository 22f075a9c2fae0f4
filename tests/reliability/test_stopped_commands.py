"""Commands in processes of their own, stopped while they work."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from table_scene import MESHES, photograph, placed

import brrp_cli
from brrp_cli.cli import COMMANDS, LazyGroup, main
from brrp_cli.frames.npz import save_frame
from brrp_cli.stop import TerminatedError, sigterm_raises


@pytest.mark.long
@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_stopped_reconstruction_leaves_nothing(
    sent: signal.Signals, code: int, tmp_path: Path
) -> None:
    mesh = MESHES["box"]().copy().apply_transform(placed(0.0, 0.0, 0.5))
    save_frame(photograph({1: mesh}), tmp_path / "frame.npz")
    command = ["reconstruct", "frame.npz", "--method", "vprism", "-o", "out"]
    with subprocess.Popen(
        [sys.executable, "-m", "brrp_cli", *command],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(brrp_cli.__file__).parents[1])},
        stderr=subprocess.PIPE,
        text=True,
        # A shell lets its background processes, and theirs, ignore Ctrl-C.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        assert process.stderr is not None
        assert "Method" in process.stderr.readline()
        process.send_signal(sent)
        told = process.stderr.read()
    assert process.returncode == code, told
    assert "Error: Stopped" in told and "Traceback" not in told
    assert [path.name for path in tmp_path.iterdir()] == ["frame.npz"]


@pytest.mark.parametrize(
    ("stop", "code"), [(KeyboardInterrupt, 130), (TerminatedError, 143)], ids=["Ctrl-C", "SIGTERM"]
)
def test_any_command_that_is_stopped_says_so_and_has_its_code(
    stop: type[KeyboardInterrupt], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    import click

    @click.command()
    def working() -> None:
        raise stop

    monkeypatch.setattr(LazyGroup, "get_command", lambda self, ctx, name: working)
    for name in COMMANDS:
        result = CliRunner().invoke(main, [name])
        assert result.exit_code == code
        assert result.stderr.startswith("Error: Stopped")


def test_sigterm_is_raised_where_the_program_is_and_the_handler_is_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(TerminatedError), sigterm_raises():
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before
