"""meta.mat of GraspNet: the camera of an image in MATLAB's format, read by SciPy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.files import trouble_of
from brrp_cli.frames.arrays import check_file

MATRIX, FACTOR = "intrinsic_matrix", "factor_depth"
_MOST_BYTES = 2**24


@dataclass(frozen=True)
class Meta:
    """K : (3, 3), pixels; depth_scale : metres that one unit of depth is (1 / factor_depth)."""

    K: NDArray[np.float64]
    depth_scale: float


def read_meta(path: Path) -> Meta:
    """Camera and unit of depth of a meta.mat. Errors: FrameError."""
    check_file(path)
    if path.stat().st_size > _MOST_BYTES:
        raise FrameError("The file is too large for a meta.mat", where=path)
    try:
        found = import_library("scipy.io").loadmat(path, variable_names=[MATRIX, FACTOR])
    except Exception as error:
        # SciPy's reader raises whatever the damaged file made it stumble over.
        raise FrameError(
            "The meta.mat cannot be read",
            where=path,
            expected=f"MATLAB's format up to 7.2, with {MATRIX} and {FACTOR}",
            found=trouble_of(error),
        ) from error
    return Meta(_numbers(found, MATRIX, (3, 3), path), 1 / _factor(found, path))


def _factor(found: dict[str, Any], path: Path) -> float:
    factor = float(_numbers(found, FACTOR, (), path))
    if not (factor > 0 and math.isfinite(1 / factor)):
        raise FrameError("The factor of depth is no positive number", where=path, found=factor)
    return factor


def _numbers(
    found: dict[str, Any], key: str, shape: tuple[int, ...], path: Path
) -> NDArray[np.float64]:
    value = np.asarray(found.get(key, ()))
    if value.dtype.kind not in "iuf" or value.size != math.prod(shape):
        raise FrameError(
            f"The meta.mat has no {key}",
            where=path,
            expected=f"{math.prod(shape)} numbers",
            found=f"{value.dtype}, shape {value.shape}" if key in found else "no such variable",
        )
    return value.reshape(shape).astype(np.float64)
