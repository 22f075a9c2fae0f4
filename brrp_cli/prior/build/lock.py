"""One builder at a time."""

from __future__ import annotations

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
