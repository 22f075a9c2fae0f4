"""One builder at a time, and an orderly end when somebody stops it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from brrp_cli.errors import PriorError
from brrp_cli.files import cannot_write


@contextmanager
def only_builder(out: Path) -> Iterator[None]:
    """Make the folder and hold its lock. Errors: PriorError, at once, when another holds it;
    OutputError when the folder cannot be written."""
    import filelock

    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = filelock.FileLock(out / ".lock", timeout=0)
        lock.acquire()
    except filelock.Timeout as error:
        raise PriorError(
            "Another build is at work on this prior",
            where=out,
            fix="wait until it has ended, or choose another folder with -o",
        ) from error
    except OSError as error:
        raise cannot_write(out, error) from error
    try:
        yield
    finally:
        lock.release()


@contextmanager
def sigterm_is_ctrl_c() -> Iterator[None]:
    """SIGTERM becomes KeyboardInterrupt, as Ctrl-C does. Only the main thread can arrange that."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
