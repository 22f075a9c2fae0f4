"""The convex hull of what is seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]

CHUNK = 512


def hull_facets(points: Array, thickness: float) -> Array:
    """The convex hull of points (n, 3) as facets (f, 4): outward unit normal and offset.

    thickness : metres, standard deviation by which points in one plane, which have no hull, move
    """
    try:
        hull = ConvexHull(points)
    except QhullError:
        # Fewer than four points, or all in one plane.
        rng = np.random.default_rng(0)
        copies = np.concatenate([points] * 4)
        hull = ConvexHull(copies + rng.normal(0, thickness, copies.shape))
    # Qhull splits a flat facet into triangles of one equation.
    return np.unique(hull.equations.round(6), axis=0)


def outside_hull(points: Array, facets: Array) -> Array:
    """How far (n,) points (n, 3) lie outside of a hull's facets (f, 4), less than 0 inside: a lower
    bound of the distance to the hull."""
    # In float32 about the middle of the hull, and so many points at once that their products, one
    # for each facet, stay in the cache.
    middle = -np.linalg.pinv(facets[:, :3]) @ facets[:, 3]
    near = np.ascontiguousarray((points - middle).T, dtype=np.float32)
    offsets = (facets[:, 3] + facets[:, :3] @ middle).astype(np.float32)[:, None]
    normals = facets[:, :3].astype(np.float32)
    found = np.empty(len(points))
    for start in range(0, len(points), CHUNK):
        chunk = slice(start, start + CHUNK)
        found[chunk] = (normals @ near[:, chunk] + offsets).max(axis=0)
    return found
