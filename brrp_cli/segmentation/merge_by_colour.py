"""Parts of one vivid colour: what a crease alone takes for two things, and is one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import VividColourConfig
from brrp_cli.dependencies import import_library

Array = NDArray[np.float64]


def vivid_hues(
    parts: NDArray[np.int64], rgb: NDArray[np.uint8], config: VividColourConfig
) -> Array:
    """(n + 1,) the hue of each part of (H, W), degrees; NaN of what has no single vivid colour.

    rgb : (H, W, 3)
    """
    hue, vivid = _hue(rgb, config)
    hues = np.full(int(parts.max()) + 1, np.nan)
    ndimage = import_library("scipy.ndimage")
    for i, window in enumerate(ndimage.find_objects(parts), start=1):
        if window is None:
            continue
        mask = parts[window] == i
        own = hue[window][mask & vivid[window]]
        if len(own) < config.vivid * mask.sum():
            continue
        mean = float(np.degrees(np.angle(np.exp(1j * np.radians(own)).mean())))
        if np.median(_turn(own, mean)) < config.spread:
            hues[i] = mean
    return hues


def same_hue(first: float, second: float, config: VividColourConfig) -> bool:
    """Whether two hues, degrees, are one; NaN is like none."""
    return bool(_turn(np.array(first), second) < config.same)


def _turn(hues: Array, other: float) -> Array:
    """Degrees from each hue to the other, the shorter way round."""
    return np.asarray(np.abs((hues - other + 180.0) % 360.0 - 180.0))


def _hue(rgb: NDArray[np.uint8], config: VividColourConfig) -> tuple[Array, NDArray[np.bool_]]:
    """(H, W) degrees of (H, W, 3), and where the colour is vivid enough to have one."""
    red, green, blue = np.moveaxis(rgb.astype(np.float64) / 255.0, -1, 0)
    high = np.maximum(np.maximum(red, green), blue)
    range_ = high - np.minimum(np.minimum(red, green), blue)
    # The angle in the plane across the grey axis, as in all spaces of hue.
    angle = np.arctan2(np.sqrt(3.0) * (green - blue), 2.0 * red - green - blue)
    return np.degrees(angle), (range_ > config.saturation * high) & (high > config.value)
