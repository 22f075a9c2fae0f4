"""Arrays that were handed in under another's name, told by their shape and type."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_WHAT = {
    "rgb": "a colour image",
    "xyz": "an image of points",
    "depth": "an image of depth",
    "K": "a camera's matrix",
    "T_world_cam": "a pose",
}


# How single masks become one map of ids.
JOIN_MASKS = (
    "join single masks (n, H, W): ids = np.zeros(masks.shape[1:], np.uint16);"
    " for i, mask in enumerate(masks, 1): ids[mask > 0] = i"
)
FEW = 64  # different values: depth of a table has more


def looks_like(array: NDArray[Any]) -> str | None:
    """The argument of `make_frame` that an array would be right for; None where none is clear."""
    if array.shape == (3, 3):
        return "K"
    if array.shape == (4, 4):
        return "T_world_cam"
    if array.ndim == 3 and array.shape[-1] == 3 and array.dtype.kind in "uf":
        return "rgb" if array.dtype == np.uint8 else "xyz"
    if array.ndim == 2 and (array.dtype.kind == "f" or array.dtype == np.uint16):
        return "depth"
    return None


def advice(name: str, array: NDArray[Any]) -> str | None:
    """What to do with an array that does not fit under `name`; None where nobody knows."""
    if name == "K" and array.size == 9:
        return "reshape it to (3, 3)"
    right = looks_like(array)
    if name == "segmap" and array.ndim == 3 and right is None:
        return JOIN_MASKS
    if right is None or right == name:
        return None
    return f"it looks like {_WHAT[right]}: pass it as {right}, and check that none are swapped"


def swapped(depth: ArrayLike, segmap: ArrayLike, most: int) -> bool:
    """Whether depth holds few different whole numbers, as ids do, and segmap more than `most`, or
    such that are not whole, as only depth does.

    Only tells one error from another: such a segmap is none in any case.
    """
    z, ids = np.asarray(depth), np.asarray(segmap)
    if z.shape != ids.shape or z.dtype.kind not in "iub" or ids.dtype.kind not in "iuf":
        return False
    known = ids[np.isfinite(ids)]
    whole = ids.dtype.kind != "f" or bool((known == np.floor(known)).all())
    return (not whole or len(np.unique(known)) > most) and len(np.unique(z)) <= FEW
