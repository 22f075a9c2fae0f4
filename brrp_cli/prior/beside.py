"""Files of arrays beside a prior: what is made from it once, and kept for later commands.

They are no part of what the prior's manifest vouches for: deleting one costs the time to make it
again. A file is named after all that decides it, and a new one takes the place of older ones.
"""

from __future__ import annotations

import hashlib
import json
import logging
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import OutputError
from brrp_cli.files import atomic_path

T = TypeVar("T")

log = logging.getLogger(__name__)


def path_beside(folder: Path, stem: str, made_from: object) -> Path:
    """Where arrays are kept that plain JSON `made_from` decides: FOLDER/STEM-XXXXXXXXXXXXXXXX.npz,
    of a stem without a hyphen."""
    digest = hashlib.sha256(json.dumps(made_from).encode()).hexdigest()
    return folder / f"{stem}-{digest[:16]}.npz"


def read_beside(path: Path, made_of: Callable[[dict[str, NDArray[Any]]], T]) -> T | None:
    """What `made_of` makes of the arrays that were kept; None where there are none, or others than
    it expects (KeyError, ValueError, TypeError), or damaged ones."""
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as file:
            return made_of({name: file[name] for name in file.files})
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        log.info("%s is damaged and is made anew: %s", path, error)
        return None


def keep_beside(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write them in the place of what was kept before, or say why not: a prior that cannot be
    written can still be used."""
    try:
        with atomic_path(path) as partial, partial.open("wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]
        for other in path.parent.glob(f"{path.stem.split('-')[0]}-*.npz"):
            if other != path:
                other.unlink(missing_ok=True)
    except (OutputError, OSError) as error:
        log.info("%s cannot be kept: %s", path, error)
