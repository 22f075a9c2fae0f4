"""The rectangle on the support plane that what is seen fits into: boxes end at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import CompletionConfig

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlanRectangle:
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


def plan_rectangle(points: Array, config: CompletionConfig) -> PlanRectangle:
    """The rectangle about points (n, 2), metres, that is small and has the points near its sides.

    Area alone does not tell: two sides of a box fit as tightly with their diagonal along a side.
    """
    few = points[:: max(1, len(points) // config.turned_points)]
    step = np.pi / 2 / config.turns
    angle = _best(few, step * np.arange(config.turns), config)
    angle = _best(few, angle + step * np.linspace(-0.8, 0.8, 9), config)
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    low, high = np.quantile(points @ axes.T, config.rectangle_most, axis=0)
    half = np.maximum(high - low, config.least_side) / 2
    centre = (low + high) / 2 @ axes
    order = np.argsort(-half, kind="stable")
    return PlanRectangle(centre, axes[order], half[order])


def _best(points: Array, angles: NDArray[np.floating], config: CompletionConfig) -> float:
    """Which of some angles (t,) the rectangle about points (n, 2) has."""
    along = np.stack([np.cos(angles), np.sin(angles)])
    area, near = np.ones(len(angles)), []
    for direction in (along, np.stack([-along[1], along[0]])):
        coordinates = points @ direction  # (n, t)
        low, high = np.quantile(coordinates, config.rectangle_most, axis=0)
        area *= np.maximum(high - low, config.least_side)
        near.append(np.minimum(np.abs(coordinates - low), np.abs(coordinates - high)))
    within = np.minimum(*near).mean(axis=0) / np.sqrt(area)
    return float(angles[np.argmin(np.log(area) + within)])
