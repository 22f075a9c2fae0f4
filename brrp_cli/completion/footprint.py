"""The rectangle on the support plane that what is seen fits into: boxes end at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Turns of the rectangle that are tried, over a quarter of a circle.
TURNS = 30
# Shares of the points between which the rectangle lies: strays do not count.
MOST = (0.01, 0.99)
# No side of a rectangle is shorter, metres.
LEAST = 0.004
# Points that its turn is found with.
POINTS = 800


@dataclass(frozen=True)
class Footprint:
    """centre : (2,); axes : (2, 2), unit rows, the longer side's first; half : (2,) half of the
    sides' lengths, metres."""

    centre: Array
    axes: Array
    half: Array

    def outside(self, points: Array) -> Array:
        """How far (n,) points (n, 2), metres, lie outside of the rectangle, negative inside."""
        over = np.abs((points - self.centre) @ self.axes.T) - self.half
        return np.asarray(
            np.hypot(*np.maximum(over, 0).T) + np.minimum(over.max(axis=1), 0), dtype=np.float64
        )


def footprint(points: Array) -> Footprint:
    """The rectangle of least area about points (n, 2), metres."""
    few = points[:: max(1, len(points) // POINTS)]
    angles = np.linspace(0, np.pi / 2, TURNS, endpoint=False)
    turned = np.stack([np.cos(angles), np.sin(angles)], axis=1)  # (t, 2)
    along = few @ turned.T
    across = few @ np.stack([-turned[:, 1], turned[:, 0]])
    sides = [
        np.maximum(np.ptp(np.quantile(each, MOST, axis=0), axis=0), LEAST)
        for each in (along, across)
    ]
    best = turned[np.argmin(sides[0] * sides[1])]
    axes = np.array([best, [-best[1], best[0]]])
    low, high = np.quantile(points @ axes.T, MOST, axis=0)
    half = np.maximum(high - low, LEAST) / 2
    centre = (low + high) / 2 @ axes
    order = np.argsort(-half, kind="stable")
    return Footprint(centre, axes[order], half[order])
