"""A part of a plane within a convex outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.hulls import beyond_hull, in_hull
from brrp_cli.observation.support_plane import Plane

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Outlined:
    """plane : the camera's side is positive
    axes : (2, 3) float64, unit, that span it, or one that leans against it by little: plan
        coordinates are points @ axes.T
    hull : (m, 3) float64: plan points p with hull[:, :2] @ p + hull[:, 2] <= 0 lie within it
    """

    plane: Plane
    axes: NDArray[np.float64]
    hull: NDArray[np.float64]

    def plan(self, points: Floats) -> NDArray[np.float64]:
        """Plan coordinates (..., 2), metres, of points (..., 3), camera frame."""
        return np.asarray(points @ self.axes.T, dtype=np.float64)

    def at(self, plan: Floats, level: float) -> NDArray[np.float64]:
        """(n, 3) the points, camera frame, `level` metres above the plane, that have plan
        coordinates (n, 2)."""
        sides = np.vstack([self.axes, self.plane.normal])
        known = np.column_stack([plan, np.full(len(plan), level - self.plane.offset)])
        return np.asarray(np.linalg.solve(sides, known.T).T, dtype=np.float64)

    def holds(self, plan: Floats, margin: float) -> NDArray[np.bool_]:
        """(n,) whether plan points (n, 2) lie within it or at most `margin` metres beside it."""
        return in_hull(self.hull, plan, margin)

    def beside(self, plan: Floats) -> NDArray[np.float64]:
        """(...,) how far beside it plan points (..., 2) lie, metres; 0 or less within it."""
        return beyond_hull(self.hull, plan.reshape(-1, 2)).reshape(plan.shape[:-1])
