"""How far the camera looks into what it saw: a bowl or a mug, whatever its walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.floating]


def opening(seen: Array, eye: Array, share: float) -> float:
    """Depth, over the longest extent, within which a `share` of the seen points lies behind the
    near side of their convex hull. Of a solid that is about 0; of a bowl, its rim spans that side.

    seen : (n, 3) points of an object's surface; eye : (3,) the camera, in their frame
    """
    points = np.asarray(seen, dtype=np.float64)
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # too few of them, or all in one plane
        return 0.0
    middle = points[hull.simplices].mean(axis=1)
    near = np.einsum("fi,fi->f", hull.equations[:, :3], middle - eye) < 0
    if not near.any():
        return 0.0
    normals, offsets = hull.equations[near, :3], hull.equations[near, 3]
    behind = -(points @ normals.T + offsets).max(axis=1)
    return float(np.quantile(behind, share) / np.ptp(points, axis=0).max())
