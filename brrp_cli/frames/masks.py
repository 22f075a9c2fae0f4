"""Object ids of pixels, checked: what is no map of ids, and a background that is not 0."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import BACKGROUND
from brrp_cli.frames.misplaced import advice

log = logging.getLogger(__name__)

MAX_OBJECTS = 1000
VOID = -1  # what most programs write where there is no object
# An id that has more of the image than this, and touches all of its borders, looks like background.
_LARGE = 0.5
_EXPECTED = "0 = background, any other id is an object"


def check_masks(
    segmap: ArrayLike, source: Path | None, *, background_told: bool = False
) -> NDArray[np.int64]:
    """Object ids (H, W) of `segmap`.

    background_told : whether somebody else tells which ids are background

    Errors: FrameError for what is no map of ids, and for one whose background cannot be 0 but where
    it is told.
    """
    ids = np.asarray(segmap)
    if ids.ndim == 3 and ids.shape[-1] == 1:
        ids = ids[..., 0]
    whole = ids.dtype.kind in "iub" or (
        ids.dtype.kind == "f" and bool(np.isfinite(ids).all() and (ids == np.floor(ids)).all())
    )
    if ids.ndim != 2 or not whole or (ids.size and np.abs(ids.astype(np.float64)).max() >= 2**62):
        raise FrameError(
            "segmap is no map of object ids",
            where=source,
            expected=f"(H, W) whole numbers, {_EXPECTED}",
            found=f"shape {ids.shape}, dtype {ids.dtype}",
            fix=advice("segmap", ids),
        )
    ids = ids.astype(np.int64)
    names, pixels = np.unique(ids, return_counts=True)
    if len(names) > MAX_OBJECTS:
        raise FrameError(
            "segmap holds too many objects",
            where=source,
            expected=f"at most {MAX_OBJECTS} different ids",
            found=len(names),
            fix="check that it is the map of object ids, and not depth or colour",
        )
    if ids.size and not background_told:
        _check_background(ids, dict(zip(names.tolist(), pixels.tolist(), strict=True)), source)
    return ids


def _check_background(ids: NDArray[np.int64], pixels: dict[int, int], source: Path | None) -> None:
    """Errors: FrameError for void that is not 0, and for several objects without background. A
    warning for an object that looks like background: one that fills the image before a near camera
    does, too.

    pixels : how many each id has
    """
    largest = max(pixels, key=lambda i: pixels[i])
    everywhere = pixels[largest] > _LARGE * ids.size and _touches_all_borders(ids == largest)
    void = VOID if VOID in pixels else largest if everywhere and largest < 0 else None
    if void is not None:
        raise FrameError(
            f"The masks mark with {void} what is no object",
            where=source,
            expected=_EXPECTED,
            found=_share(void, pixels[void], ids.size),
            fix=f"set these pixels to 0: segmap[segmap == {void}] = 0",
        )
    if BACKGROUND not in pixels and len(pixels) > 1:
        raise FrameError(
            "The masks have no background",
            where=source,
            expected=_EXPECTED,
            found=f"no pixel is 0; {_share(largest, pixels[largest], ids.size)}",
            fix=f"set what is no object to 0; if that is {largest}:"
            f" segmap[segmap == {largest}] = 0",
        )
    if everywhere and largest != BACKGROUND:
        log.warning(
            "%s: object %d covers %.3g %% of the image and touches all of its borders: if it is the"
            " background, set its pixels to 0",
            source or "The masks",
            largest,
            100 * pixels[largest] / ids.size,
        )


def _share(object_id: int, pixels: int, size: int) -> str:
    return f"{object_id} in {100 * pixels / size:.3g} % of the pixels"


def _touches_all_borders(mask: NDArray[np.bool_]) -> bool:
    return bool(mask[0].any() and mask[-1].any() and mask[:, 0].any() and mask[:, -1].any())
