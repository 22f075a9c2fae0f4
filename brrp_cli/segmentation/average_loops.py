"""Means over neighbouring pixels, as machine code. See `compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Floats = NDArray[np.float32]


@compiled
def averaged(padded: Floats, scale: Floats, radius: int) -> Floats:
    """The mean (H, W) of each value and its neighbours, up to `radius` pixels away along each axis,
    weighed by a bell of d, their difference times `scale` (H, W).

    padded : (H + 2 radius, W + 2 radius)
    The bell is (1 - d^2 / 64)^64, 0 beyond: exp(-d^2) to within 0.005, without a call for each.
    """
    height, width = scale.shape
    found = np.empty((height, width), np.float32)
    one, share, none = np.float32(1.0), np.float32(1 / 64), np.float32(0.0)
    # Below it float32 holds the 64th power as a denormal number, or not at all.
    least = np.float32(0.27)
    for i in range(height):
        own, by = padded[i + radius, radius : radius + width], scale[i] * scale[i] * share
        total, weights = np.zeros(width, np.float32), np.zeros(width, np.float32)
        for row in range(i, i + 2 * radius + 1):
            for column in range(2 * radius + 1):
                # The innermost loop is along a row, which processors do eight at a time.
                for j in range(width):
                    # Of the difference, which is small: float32 keeps what it means.
                    difference = padded[row, j + column] - own[j]
                    weight = one - difference * difference * by[j]
                    weight = weight if weight > least else none
                    weight *= weight
                    weight *= weight
                    weight *= weight
                    weight *= weight
                    weight *= weight
                    weight *= weight
                    weights[j] += weight
                    total[j] += weight * difference
        for j in range(width):
            found[i, j] = own[j] + total[j] / weights[j]
    return found
