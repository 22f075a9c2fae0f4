"""Upper edges of an object whose depth runs over into that of what is behind it.

Stereo cameras match windows of pixels. Over the far rim of a bowl, say, depth does not jump to the
table behind: it runs there over several pixels, which the mask holds, since colour shows the rim
there. Such a ramp is in space that the object's true shape leaves free, and all that would be right
is contradicted by it. Cameras are held upright and look down: what lies beyond the upper edge of an
object is further away. Along its lower edge a wall that is seen from above looks alike, and is one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import BledEdgeConfig


def bled_pixels(
    depth: NDArray[np.floating], focal: float, config: BledEdgeConfig
) -> NDArray[np.bool_]:
    """(H, W) bool: pixels of ramps at the upper edge, and those above them.

    depth : (H, W) metres, NaN outside the object's mask and where there is no return; focal :
    pixels, along columns
    """
    up = depth[::-1]
    bled = np.zeros(up.shape, dtype=bool)
    while True:
        found = _ramps(np.where(bled, np.nan, up), focal, config)
        if not found.any():
            return bled[::-1]
        bled |= found


def _ramps(up: NDArray[np.floating], focal: float, config: BledEdgeConfig) -> NDArray[np.bool_]:
    """The same of an image whose rows go up: of each column the last ramp, where it ends at the
    edge."""
    height, width = up.shape
    own = np.isfinite(up)
    if height <= config.steps:
        return np.zeros(up.shape, dtype=bool)
    step = np.diff(up, axis=0)
    steep = (step > config.slope * up[:-1] / focal) & (step < config.jump)
    rows = np.arange(height)[:, None]
    # How many steps are steep, one after the other, up to each.
    before = np.maximum.accumulate(np.where(steep, -1, rows[:-1]), axis=0)
    ends = np.where(rows[:-1] - before >= config.steps, rows[:-1], -1)
    last = ends.max(axis=0)
    columns = np.arange(width)
    first = before[np.maximum(last, 0), columns] + 1
    above = own & (rows > last + 1)
    ramp = (last >= 0) & (above.sum(axis=0) <= config.border)
    return own & ramp & (rows > first)
