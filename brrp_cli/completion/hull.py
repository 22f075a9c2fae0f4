"""The convex hull of what is seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]

# Points in one plane have no hull: they are moved by this standard deviation, metres.
THICKNESS = 0.0005


def hull_facets(points: Array) -> Array:
    """The convex hull of points (n, 3) as facets (f, 4): outward unit normal and offset."""
    try:
        hull = ConvexHull(points)
    except QhullError:
        # Fewer than four points, or all in one plane.
        rng = np.random.default_rng(0)
        copies = np.concatenate([points] * 4)
        hull = ConvexHull(copies + rng.normal(0, THICKNESS, copies.shape))
    # Qhull splits a flat facet into triangles of one equation.
    return np.unique(hull.equations.round(6), axis=0)


def outside_hull(points: Array, facets: Array) -> Array:
    """How far (n,) points (n, 3) lie outside of a hull's facets (f, 4), less than 0 inside: a lower
    bound of the distance to the hull."""
    return np.asarray((points @ facets[:, :3].T + facets[:, 3]).max(axis=1))
