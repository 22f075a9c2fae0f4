"""Arrays of true meshes that are kept on disk, since it takes seconds to make them."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import SceneError
from brrp_cli.files import trouble_of


def read_kept(path: Path, *names: str) -> list[NDArray[Any]]:
    """The arrays of those names. Errors: SceneError where the file is damaged."""
    try:
        if not zipfile.is_zipfile(path):
            raise ValueError("bytes that are no NumPy archive, or not all of one")
        with np.load(path, allow_pickle=False) as arrays:
            return [arrays[name] for name in names]
    except Exception as error:
        # NumPy's reader raises whatever the damaged file made it stumble over.
        raise SceneError(
            "What was kept of a true mesh is damaged",
            where=path,
            expected=f"a NumPy archive with {' and '.join(names)}",
            found=trouble_of(error),
            fix="remove the file: it is made again",
        ) from error
