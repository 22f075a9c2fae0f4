"""The shape of a seen side as a histogram over pairs of its points.

Distance of the two points, in metres, against the angle between their normals: the D2 shape
distribution (Osada et al. 2002) with the normals of point-pair features. No pose enters, and size
does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import cells_of

# Metres; finer where small things differ.
DISTANCES = np.array(
    [0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.065, 0.08, 0.1, 0.12, 0.15, 0.18, 0.22, 0.27, 0.33, 0.4]
)
# Cosine of the angle between normals -> position on the axis of ANGLE_BINS nodes.
_COSINES = np.array([-1.0, 0.0, 0.7, 0.97, 1.0])
_NODES = np.array([0.0, 0.8, 1.8, 2.8, 3.0])
ANGLE_BINS = 4
PAIR_BINS = len(DISTANCES) * ANGLE_BINS
# One point for each cell of this edge, metres, and so many of them.
CELL = 0.005
MAX_POINTS = 300
MIN_POINTS = 8


def pair_histogram(
    points: NDArray[np.floating], normals: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Histogram (PAIR_BINS,), sum 1, of points (n, 3), metres, with unit normals (n, 3).

    All 0 where there are fewer than `MIN_POINTS`. The same points give the same histogram.
    """
    from scipy.spatial.distance import pdist

    points, normals = _thinned(np.asarray(points, np.float64), np.asarray(normals, np.float64))
    if len(points) < MIN_POINTS:
        return np.zeros(PAIR_BINS, np.float32)
    distance = pdist(points)
    above = np.triu(np.ones((len(points), len(points)), dtype=np.bool_), 1)
    # All products and then half of them is faster than to gather the normals of each pair.
    cosine = np.clip(np.einsum("ik,jk->ij", normals, normals)[above], -1, 1)
    x = np.interp(distance, DISTANCES, np.arange(len(DISTANCES)))
    y = np.interp(cosine, _COSINES, _NODES)
    counts = np.zeros(PAIR_BINS)
    # Shared linearly among the four nodes around each pair.
    low_x = np.minimum(x.astype(np.int64), len(DISTANCES) - 2)
    low_y = np.minimum(y.astype(np.int64), ANGLE_BINS - 2)
    for step_x, weight_x in ((0, 1 - (x - low_x)), (1, x - low_x)):
        for step_y, weight_y in ((0, 1 - (y - low_y)), (1, y - low_y)):
            index = (low_x + step_x) * ANGLE_BINS + low_y + step_y
            counts += np.bincount(index, weight_x * weight_y, minlength=PAIR_BINS)
    return (counts / counts.sum()).astype(np.float32)


def _thinned(
    points: NDArray[np.float64], normals: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if len(points) == 0:
        return points, normals
    rows = np.sort(np.unique(cells_of(points, CELL), return_index=True)[1])
    if len(rows) > MAX_POINTS:
        # A fixed draw: descriptors are not to hang on a seed.
        rows = np.sort(np.random.default_rng(0).choice(rows, MAX_POINTS, replace=False))
    return points[rows], normals[rows]
