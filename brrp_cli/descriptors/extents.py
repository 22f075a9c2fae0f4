"""Metric size of something that stands on a plane: its height and its footprint."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_ANGLES = np.linspace(0, np.pi / 2, 18, endpoint=False)


def footprint(points: NDArray[np.floating], share: float = 1.0) -> NDArray[np.float64]:
    """Sides (2,), the long one first, of the smallest of the rectangles, turned by steps of 5
    degrees, around points (n, 2).

    share : of the points that lie between two opposite sides; less than 1 forgets stray points.
    """
    tail = (1 - share) / 2
    best = np.full(2, np.inf)
    for angle in _ANGLES:
        c, s = np.cos(angle), np.sin(angle)
        turned = points @ np.array([[c, -s], [s, c]])
        if tail:
            low, high = np.quantile(turned, [tail, 1 - tail], axis=0)
        else:
            low, high = turned.min(axis=0), turned.max(axis=0)
        sides = np.asarray(high - low, dtype=np.float64)
        if sides.prod() < best.prod():
            best = sides
    return np.sort(best)[::-1]


def standing_size(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Height and both sides of the footprint (3,) of points (n, 3), z up."""
    return np.array([np.ptp(points[:, 2]), *footprint(points[:, :2])])
