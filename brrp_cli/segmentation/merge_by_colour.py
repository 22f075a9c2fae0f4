"""Parts of one vivid colour: what a crease alone takes for two things, and is one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Of a pixel, 0 to 1. Below it, hue is noise: of grey things colour says nothing.
_SATURATION, _VALUE = 0.4, 0.3
_SHARE = 0.35  # of a part's pixels that are vivid; cameras smear grey of the table over edges
_SPREAD = 10.0  # degrees of hue, median deviation within a part: more is a printed thing
_SAME = 15.0  # degrees of hue between two parts; light from two sides shifts it so much


def vivid_hues(parts: NDArray[np.int64], rgb: NDArray[np.uint8]) -> Array:
    """(n + 1,) the hue of each part of (H, W), degrees; NaN of what has no single vivid colour.

    rgb : (H, W, 3)
    """
    hue, vivid = _hue(rgb)
    hues = np.full(int(parts.max()) + 1, np.nan)
    for i in np.unique(parts[parts > 0]):
        mask = parts == i
        own = hue[mask & vivid]
        if len(own) < _SHARE * mask.sum():
            continue
        mean = float(np.degrees(np.angle(np.exp(1j * np.radians(own)).mean())))
        if np.median(_turn(own, mean)) < _SPREAD:
            hues[i] = mean
    return hues


def same_hue(first: float, second: float) -> bool:
    """Whether two hues, degrees, are one; NaN is like none."""
    return bool(_turn(np.array(first), second) < _SAME)


def _turn(hues: Array, other: float) -> Array:
    """Degrees from each hue to the other, the shorter way round."""
    return np.asarray(np.abs((hues - other + 180.0) % 360.0 - 180.0))


def _hue(rgb: NDArray[np.uint8]) -> tuple[Array, NDArray[np.bool_]]:
    """(H, W) degrees of (H, W, 3), and where the colour is vivid enough to have one."""
    red, green, blue = np.moveaxis(rgb.astype(np.float64) / 255.0, -1, 0)
    high = np.maximum(np.maximum(red, green), blue)
    range_ = high - np.minimum(np.minimum(red, green), blue)
    # The angle in the plane across the grey axis, as in all spaces of hue.
    angle = np.arctan2(np.sqrt(3.0) * (green - blue), 2.0 * red - green - blue)
    return np.degrees(angle), (range_ > _SATURATION * high) & (high > _VALUE)
