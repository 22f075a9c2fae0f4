"""Farthest-point order of a cloud: each point is the one furthest from all before it.

Every leading part of such an order covers the cloud as well as its length allows, so that one order
serves all layers of an encoder that needs fewer and fewer points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def farthest_points(points: NDArray[np.floating], count: int) -> NDArray[np.float32]:
    """The first `count` points (count, 3) of the farthest-point order of points (n, 3), n > 0.

    It begins with the point furthest from the middle of the bounding box, so that neither the order
    nor the number of pixels decides it. A cloud of fewer points is repeated from its beginning.
    """
    cloud = np.asarray(points, dtype=np.float32)
    # Sorted, so that ties fall the same way in whatever order the pixels came; in columns, which is
    # several times as fast.
    columns = np.ascontiguousarray(cloud[np.lexsort(cloud.T)].T)
    middle = (columns.min(axis=1) + columns.max(axis=1)) / 2
    chosen = [int(np.argmax(_squared(columns, middle)))]
    nearest = _squared(columns, columns[:, chosen[0]])
    while len(chosen) < min(count, columns.shape[1]):
        chosen.append(int(np.argmax(nearest)))
        np.minimum(nearest, _squared(columns, columns[:, chosen[-1]]), out=nearest)
    return np.resize(columns[:, chosen].T, (count, 3))


def _squared(columns: NDArray[np.float32], point: NDArray[np.float32]) -> NDArray[np.float32]:
    """Squared distances (n,) of columns (3, n) to a point (3,)."""
    x, y, z = (column - value for column, value in zip(columns, point, strict=True))
    return np.asarray(x * x + y * y + z * z)
