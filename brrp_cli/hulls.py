"""Convex hulls in the plane, as half planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library


def convex_hull(plan: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Half planes (m, 3) of the convex hull of plan points (n, 2); None if it has no area."""
    spatial = import_library("scipy.spatial")
    try:
        return np.asarray(spatial.ConvexHull(plan).equations, dtype=np.float64)
    except (spatial.QhullError, ValueError):
        return None


def in_hull(
    hull: NDArray[np.float64], plan: NDArray[np.floating], margin: float
) -> NDArray[np.bool_]:
    """(n,) whether plan points (n, 2) lie in a hull (m, 3) grown by `margin`."""
    # Edge by edge: a table of all points and edges would not fit the cache.
    x, y = np.ascontiguousarray(plan[:, 0]), np.ascontiguousarray(plan[:, 1])
    inside = np.ones(len(plan), dtype=bool)
    for a, b, c in hull:
        inside &= a * x + b * y <= margin - c
    return inside


def beyond_hull(hull: NDArray[np.float64], plan: NDArray[np.floating]) -> NDArray[np.float64]:
    """(n,) how far plan points (n, 2) lie beyond the nearest side of a hull (m, 3); less than 0
    inside."""
    x, y = np.ascontiguousarray(plan[:, 0]), np.ascontiguousarray(plan[:, 1])
    beyond = np.full(len(plan), -np.inf)
    for a, b, c in hull:
        np.maximum(beyond, a * x + b * y + c, out=beyond)
    return beyond
