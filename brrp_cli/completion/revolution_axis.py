"""The axis of a surface of revolution, from points on it and their normals.

Every normal of a surface of revolution lies in a plane with its axis: with a direction a and a
point c of the axis, n . (a x (p - c)) = 0 for each point p with normal n. For a known direction
that is linear in c. For an unknown one it is linear in the axis as a line (a, a x c) of six numbers
(Pottmann and Randrup, "Rotational and helical surface approximation for reverse engineering",
Computing 60, 1998). Points that are off, such as those of a handle, lose their say step by step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import normalise

Array = NDArray[np.float64]

# Share of a matrix's trace that keeps it from being singular; the square root of it is the least
# share of its largest eigenvalue that counts as one.
LEAST = 1e-6


@dataclass(frozen=True)
class Axis:
    """point : (3,) metres; direction : (3,) unit"""

    point: Array
    direction: Array

    @property
    def sides(self) -> Array:
        """(2, 3) unit, across the axis and across each other."""
        # The camera's axis that the direction leans to least.
        other = np.eye(3)[np.argmin(np.abs(self.direction))]
        first = normalise(np.cross(self.direction, other))
        return np.stack([first, np.cross(self.direction, first)])

    def heights(self, points: Array) -> Array:
        """(n,) of points (n, 3) along the axis, metres."""
        return np.asarray((points - self.point) @ self.direction)

    def radii(self, points: Array) -> tuple[Array, Array]:
        """Distances (n,) of points (n, 3) from the axis, metres, and unit directions (n, 3) away
        from it; 0 on it."""
        from_point = points - self.point
        away = from_point - (from_point @ self.direction)[:, None] * self.direction
        radius = np.linalg.norm(away, axis=1)
        return radius, away / np.maximum(radius, np.finfo(float).tiny)[:, None]

    def half_plane(self, points: Array) -> Array:
        """(n, 2) heights and radii of points (n, 3), metres: what a turn leaves as it is."""
        return np.stack([self.heights(points), self.radii(points)[0]], axis=1)

    def normals_in_half_plane(self, points: Array, normals: Array) -> Array:
        """(n, 2) unit, of unit normals (n, 3) of points (n, 3)."""
        _, away = self.radii(points)
        along = np.stack([normals @ self.direction, (normals * away).sum(axis=1)], axis=1)
        return normalise(along + np.finfo(float).tiny)

    def turned(self, points: Array, turns: int) -> Array:
        """Points (n, 3) at so many turns about the axis, (turns * n, 3)."""
        height, radius = self.half_plane(points).T
        angle = np.arange(turns) * (2 * np.pi / turns)
        around = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ self.sides
        on_axis = self.point + height[:, None] * self.direction
        return np.asarray((on_axis + radius[:, None] * around[:, None]).reshape(-1, 3))

    def turned_off(self, points: Array, normals: Array) -> Array:
        """(n,) sines by which unit normals (n, 3) of points (n, 3) leave the planes through the
        axis: 0 on a surface of revolution."""
        _, away = self.radii(points)
        return np.asarray(np.abs((normals * np.cross(self.direction, away)).sum(axis=1)))


def upright_axis(points: Array, normals: Array, up: Array, off: float, steps: int) -> Axis:
    """The axis along `up` (3,) of points (n, 3) with unit normals (n, 3); one that is off by a sine
    of `off` has a quarter of its say in the next of `steps` steps."""
    side = np.cross(normals, up)
    # n . (up x (p - c)) = 0, and n . (up x p) = (n x up) . p.
    asked = (side * points).sum(axis=1)
    weight = np.ones(len(points))
    middle = points.mean(axis=0)
    axis = Axis(middle, up)
    for _ in range(steps):
        # Along the axis nothing is asked for: it stays where the middle is.
        A = (side * weight[:, None]).T @ side + np.outer(up, up) * weight.sum()
        b = (side * weight[:, None]).T @ asked + up * (up @ middle) * weight.sum()
        axis = Axis(np.linalg.solve(A + LEAST * np.trace(A) * np.eye(3), b), up)
        weight = _weights(axis, points, normals, off)
    return axis


def free_axis(points: Array, normals: Array, off: float, steps: int) -> Axis:
    """The axis of points (n, 3) with unit normals (n, 3), whichever way it points."""
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(points - middle, axis=1).mean())
    local = (points - middle) / size
    moments = np.cross(local, normals)
    weight = np.ones(len(points))
    axis = Axis(middle, normals[0])
    for _ in range(steps):
        weighed = weight[:, None]
        A, B, C = (
            (weighed * moments).T @ moments,
            (weighed * moments).T @ normals,
            (weighed * normals).T @ normals,
        )
        # n . (a x (p - c)) = a . (p x n) - (a x c) . n
        inverse = np.linalg.pinv(C, rcond=LEAST**0.5, hermitian=True)
        _, vectors = np.linalg.eigh(A - B @ inverse @ B.T)
        direction = vectors[:, 0]
        moment = inverse @ B.T @ direction
        # A screw's pitch is none of a turn's.
        moment -= (moment @ direction) * direction
        point = np.cross(moment, direction)
        axis = Axis(middle + size * point, normalise(direction))
        weight = _weights(axis, points, normals, off)
    return axis


def _weights(axis: Axis, points: Array, normals: Array, off: float) -> Array:
    radius, _ = axis.radii(points)
    # The equations are lengths: near the axis they are short however wrong a normal is.
    say = 1 / np.maximum(radius, np.median(radius) / 4) ** 2
    return np.asarray(say / (1 + (axis.turned_off(points, normals) / off) ** 2) ** 2)
