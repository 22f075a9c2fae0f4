"""Grid subsampling: one point for each occupied cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_DENSE_CELLS = 2**22


def grid_subsample(points: NDArray[np.floating], cell: float) -> NDArray[np.float32]:
    """Mean of the points in each cell of a grid through the origin (paper, section IV-C).

    points : (n, 3), finite; cell : edge length in the unit of the points. Returns (m, 3) float32,
    one for each occupied cell, in the order of the cells (x slowest, z fastest).
    """
    if len(points) == 0:
        return np.empty((0, 3), np.float32)
    points = points.astype(np.float64)
    cells = np.floor(points / cell)
    cells -= cells.min(axis=0)
    if np.prod(cells.max(axis=0) + 1) <= _DENSE_CELLS:
        axes = cells.astype(np.int64)
        size = axes.max(axis=0) + 1
        index = (axes[:, 0] * size[1] + axes[:, 1]) * size[2] + axes[:, 2]
    else:  # far outliers: number the occupied cells alone
        index = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
    count = np.bincount(index)
    occupied = count > 0
    sums = np.stack([np.bincount(index, weights=points[:, axis]) for axis in range(3)], axis=-1)
    return (sums[occupied] / count[occupied, None]).astype(np.float32)
