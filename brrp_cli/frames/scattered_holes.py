"""Depth at pixels without a return that are scattered among others that have one.

Depth of a smaller image that was put into the pixels of a larger colour image leaves rows, columns
or a grid of them bare, and some cameras drop pixels all over the image. Whoever looks for a
pixel's neighbours there, for normals or edges, finds none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import ScatteredHolesConfig

Array = NDArray[np.float64]


def without_scattered_holes(
    depth: NDArray[np.floating], K: Array, config: ScatteredHolesConfig
) -> NDArray[np.floating]:
    """Depth (H, W), metres, NaN = no return, with that of scattered holes interpolated between the
    pixels beside them; the array itself where there are none, or only the few that any camera has.

    K : (3, 3) intrinsics, pixels. Holes between surfaces that lie one behind the other stay.
    """
    measured = np.isfinite(depth)
    count = int(np.count_nonzero(measured))
    if count == depth.size:
        return depth
    # Of a plane the inverse depth is linear in the pixel.
    inverse = np.where(measured, 1.0 / np.where(measured, depth, 1.0), np.nan)
    for _ in range(config.passes):
        filled, slope = _between(inverse, float(K[1, 1]), config)
        others, other_slope = (each.T for each in _between(inverse.T, float(K[0, 0]), config))
        better = other_slope < slope
        found = np.where(better, others, filled)
        inverse = np.where(np.isfinite(inverse), inverse, found)
    holes = np.isfinite(inverse) & ~measured
    if np.count_nonzero(holes) < max(config.least * count, config.least_pixels):
        return depth
    return np.where(holes, 1.0 / inverse, depth).astype(depth.dtype)


def _between(inverse: Array, focal: float, config: ScatteredHolesConfig) -> tuple[Array, Array]:
    """Inverse depth (H, W) at holes between measured pixels above and below, NaN elsewhere, and the
    slope, tan of the angle at which the line of sight meets what joins these, inf elsewhere."""
    rows = np.arange(len(inverse), dtype=np.int32)[:, None]
    measured = np.isfinite(inverse)
    none = 2 * len(inverse)
    above = np.maximum.accumulate(np.where(measured, rows, -none), axis=0)
    below = np.minimum.accumulate(np.where(measured, rows, none)[::-1], axis=0)[::-1]
    near = (rows - above <= config.reach) & (below - rows <= config.reach) & ~measured
    at, column = np.nonzero(near)
    up, down = at - above[near], below[near] - at
    first, last = inverse[above[near], column], inverse[below[near], column]
    # dz / (z dpixel / f), and dz / z = d(1 / z) z.
    slope = np.abs(first - last) / np.minimum(first, last) * focal / (up + down)
    filled, steep = np.full(inverse.shape, np.nan), np.full(inverse.shape, np.inf)
    joined = slope <= np.tan(np.radians(config.grazing))
    at, column = at[joined], column[joined]
    filled[at, column] = ((first * down + last * up) / (up + down))[joined]
    steep[at, column] = slope[joined]
    return filled, steep
