"""Ctrl-C and SIGTERM end a command in an orderly way, with the exit codes that shells expect."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from brrp_cli.errors import BrrpError

SIGNAL_BASE = 128


class TerminatedError(KeyboardInterrupt):
    """SIGTERM: whatever ends well on Ctrl-C ends well on this too."""


class StoppedError(BrrpError):
    """Somebody stopped the command; `exit_code` is 130 for Ctrl-C and 143 for SIGTERM."""

    exit_code = SIGNAL_BASE + signal.SIGINT


def stopped(why: KeyboardInterrupt, **told: object) -> StoppedError:
    """The message for people. told : where, found, fix of a BrrpError."""
    terminated = isinstance(why, TerminatedError)
    error = StoppedError("Stopped by SIGTERM" if terminated else "Stopped", **told)  # type: ignore[arg-type]
    if terminated:
        error.exit_code = SIGNAL_BASE + signal.SIGTERM
    return error


@contextmanager
def sigterm_raises() -> Iterator[None]:
    """SIGTERM raises TerminatedError. Only the main thread can arrange that."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _raise)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _raise(number: int, frame: FrameType | None) -> None:
    raise TerminatedError
