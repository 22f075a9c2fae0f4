"""Grid subsampling: one point for each occupied cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import cells_of

_DENSE_CELLS = 2**22


def grid_subsample(points: NDArray[np.floating], cell: float) -> NDArray[np.float32]:
    """Mean of the points in each cell of a grid through the origin (paper, section IV-C).

    points : (n, 3), finite; cell : edge length in the unit of the points. Returns (m, 3) float32,
    one for each occupied cell, in the order of the cells (x slowest, z fastest).
    """
    if len(points) == 0:
        return np.empty((0, 3), np.float32)
    # The axis comes first: long contiguous rows are what NumPy is fast on.
    columns = np.ascontiguousarray(points.T, dtype=np.float64)
    cells = np.floor(columns / cell)
    cells -= cells.min(axis=1, keepdims=True)
    size = cells.max(axis=1).astype(np.int64) + 1
    if np.prod(size, dtype=np.float64) <= _DENSE_CELLS:
        x, y, z = cells.astype(np.int64)
        index = (x * size[1] + y) * size[2] + z
    else:  # far outliers: number the occupied cells alone
        index = np.unique(cells, axis=1, return_inverse=True)[1].reshape(-1)
    count = np.bincount(index)
    occupied = count > 0
    sums = np.stack([np.bincount(index, weights=column)[occupied] for column in columns], axis=-1)
    return (sums / count[occupied, None]).astype(np.float32)


def dense_points(
    points: NDArray[np.floating], cell: float, least_share: float
) -> NDArray[np.floating]:
    """Those of points (n, 3), metres, whose grid cell of `cell` metres holds a share `least_share`
    of what the cell of a median point holds: the pixels that a sensor smears from an edge to what
    lies behind it are few and far between."""
    if not len(points):
        return points
    cell_of = cells_of(points, cell)
    around = np.bincount(cell_of)[cell_of]
    return points[around >= least_share * np.median(around)]
