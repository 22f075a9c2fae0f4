"""Convex hulls in the plane, as half planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled
from brrp_cli.dependencies import import_library

Array = NDArray[np.float64]

# So many points are sifted before Qhull sees them, and so many are tested at a time: their
# coordinates stay in the processor's nearest cache while all sides of a hull go over them.
MANY = 1000
BLOCK = 512


def convex_hull(plan: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Half planes (m, 3) of the convex hull of plan points (n, 2); None if it has no area."""
    spatial = import_library("scipy.spatial")
    outer = _outer(plan) if len(plan) > MANY else plan
    try:
        return np.asarray(spatial.ConvexHull(outer).equations, dtype=np.float64)
    except (spatial.QhullError, ValueError):
        return None


def in_hull(hull: Array, plan: NDArray[np.floating], margin: float) -> NDArray[np.bool_]:
    """(n,) whether plan points (n, 2) lie in a hull (m, 3) grown by `margin`."""
    return _in_all(hull, np.ascontiguousarray(plan, dtype=np.float64), margin)


def beyond_hull(hull: Array, plan: NDArray[np.floating]) -> Array:
    """(n,) how far plan points (n, 2) lie beyond the nearest side of a hull (m, 3); less than 0
    inside."""
    return _beyond_all(hull, np.ascontiguousarray(plan, dtype=np.float64))


def _outer(plan: Array) -> Array:
    """The points (m, 2) that lie on or outside the octagon of those that lie farthest in eight
    directions: all corners of the hull are among them."""
    spatial = import_library("scipy.spatial")
    x, y = np.ascontiguousarray(plan.T)
    corners = [each for along in (x, x + y, y, y - x) for each in (along.argmin(), along.argmax())]
    try:
        octagon = spatial.ConvexHull(plan[corners]).equations
    except (spatial.QhullError, ValueError):
        return plan
    # Not what rounding may have put inside.
    return plan[~in_hull(octagon, plan, -1e-9 * float(np.abs(plan).max()))]


@compiled
def _in_all(hull: Array, plan: Array, margin: float) -> NDArray[np.bool_]:
    """(n,) whether points (n, 2) lie within `margin` of all half planes (m, 3)."""
    found = np.ones(len(plan), np.bool_)
    x, y = np.empty(BLOCK), np.empty(BLOCK)
    for first in range(0, len(plan), BLOCK):
        inside = found[first : first + BLOCK]
        for i in range(len(inside)):
            x[i], y[i] = plan[first + i, 0], plan[first + i, 1]
        for side in range(len(hull)):
            a, b, most = hull[side, 0], hull[side, 1], margin - hull[side, 2]
            for i in range(len(inside)):
                inside[i] &= a * x[i] + b * y[i] <= most
    return found


@compiled
def _beyond_all(hull: Array, plan: Array) -> Array:
    """(n,) the farthest that points (n, 2) lie beyond any of half planes (m, 3); NaN of NaN."""
    found = np.full(len(plan), -np.inf)
    x, y = np.empty(BLOCK), np.empty(BLOCK)
    for first in range(0, len(plan), BLOCK):
        beyond = found[first : first + BLOCK]
        for i in range(len(beyond)):
            x[i], y[i] = plan[first + i, 0], plan[first + i, 1]
        for side in range(len(hull)):
            a, b, c = hull[side, 0], hull[side, 1], hull[side, 2]
            for i in range(len(beyond)):
                far = a * x[i] + b * y[i] + c
                beyond[i] = beyond[i] if beyond[i] >= far else far
    return found
