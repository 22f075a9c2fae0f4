"""The shape that fills in for an object that no stored one explains: a hull of what was seen.

The convex hull of the observed points and of their feet on the support plane: closed, standing on
the table, as large as what is visible. It fills hollows that the camera did not see to be free.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from brrp_cli.frames.plane import Plane
from brrp_cli.frames.subsample import grid_subsample

Array = NDArray[np.float64]

# Cells in which observed points are merged first: facets of noise are not worth their time.
CELL = 0.004
# Points in one plane have no hull: they are moved by this standard deviation, metres.
THICKNESS = 0.0005


def hull_points(points: NDArray[np.floating], plane: Plane | None) -> Array:
    """Observed points (n, 3), metres, camera frame, thinned, and their feet on the plane (m, 3)."""
    seen = grid_subsample(points, CELL).astype(np.float64)
    if plane is None:
        return seen
    height = np.maximum(plane.signed_distance(seen), 0.0)
    return np.concatenate([seen, seen - height[:, None] * plane.normal])


def hull_facets(points: Array) -> Array:
    """The hull of points (n, 3) as facets (f, 4): outward unit normal and offset."""
    try:
        hull = ConvexHull(points)
    except QhullError:
        noise = np.random.default_rng(0).normal(0, THICKNESS, points.shape)
        hull = ConvexHull(points + noise)
    # Qhull splits a flat facet into triangles of one equation.
    return np.unique(hull.equations.round(6), axis=0)


def hull_distance(points: Array, facets: Array) -> Array:
    """Distance (n,) of points (n, 3) to the hull: exact inside, where it is negative, and at most
    the true one outside."""
    return np.asarray((points @ facets[:, :3].T + facets[:, 3]).max(axis=1))
