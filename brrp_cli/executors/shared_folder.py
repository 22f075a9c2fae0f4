"""How a process tells whether another one, elsewhere, sees the same folder."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from brrp_cli.files import cannot_write

_TOKEN = ".brrp-shared-"


@contextmanager
def token(folder: Path | None) -> Iterator[list[Path]]:
    """A file in `folder` of a name that no other folder has: who sees it sees this very folder."""
    if folder is None:
        yield []
        return
    for left in folder.glob(f"{_TOKEN}*"):
        # Of a client that was killed.
        left.unlink(missing_ok=True)
    mark = folder / f"{_TOKEN}{uuid.uuid4().hex}"
    try:
        mark.touch()
    except OSError as error:
        raise cannot_write(mark, error) from error
    try:
        yield [mark]
    finally:
        mark.unlink(missing_ok=True)
