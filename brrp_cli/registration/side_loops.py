"""Boxes of the side of a model that faces the camera, of many placements, as machine code. See
`compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]


@compiled
def facing_boxes(turned: Array, surface: Array, normals: Array) -> tuple[Array, Array]:
    """Least and most (B, 3) along each axis of the side of a surface (m, 3) that faces against the
    last one, turned in some ways (B, 3, 3); inf and -inf where no point does."""
    low, high = np.full((len(turned), 3), np.inf), np.full((len(turned), 3), -np.inf)
    for b in range(len(turned)):
        R = turned[b]
        for m in range(len(surface)):
            n = normals[m]
            if R[2, 0] * n[0] + R[2, 1] * n[1] + R[2, 2] * n[2] >= 0:
                continue
            s = surface[m]
            for axis in range(3):
                at = R[axis, 0] * s[0] + R[axis, 1] * s[1] + R[axis, 2] * s[2]
                low[b, axis] = min(low[b, axis], at)
                high[b, axis] = max(high[b, axis], at)
    return low, high


@compiled
def lay_over(
    T_plane_model: Array,
    surface: Array,
    normals: Array,
    middle: Array,
    camera: Array,
    directions: Array,
    least_facing: int,
) -> Array:
    """Move transforms (B, 4, 4), in place, so that along the plane the box of the side of the
    surface (m, 3) that faces the camera (3,) lies over `middle` (2,); how far (B,) that side
    reaches in `directions` (B, 2).

    Which side that is, is found with the whole model laid over `middle`. One of fewer than
    `least_facing` points is all of it.
    """
    reach = np.empty(len(T_plane_model))
    counts = np.empty(len(surface), np.bool_)
    for b in range(len(T_plane_model)):
        T = T_plane_model[b]
        counts[:] = True
        _center(T, surface, counts, middle)
        toward = np.empty(3)
        for axis in range(3):
            toward[axis] = 0.0
            for i in range(3):
                toward[axis] += (camera[i] - T[i, 3]) * T[i, axis]
        number = 0
        for m in range(len(surface)):
            ahead = 0.0
            for i in range(3):
                ahead += (toward[i] - surface[m, i]) * normals[m, i]
            counts[m] = ahead > 0
            number += counts[m]
        if number < least_facing:
            counts[:] = True
        _center(T, surface, counts, middle)
        low, high = _reach(T, surface, counts, directions[b, 0], directions[b, 1])
        reach[b] = high - low
    return reach


@compiled
def with_ends(T: Array, more: Array, directions: Array, hidden: float) -> Array:
    """Transforms (B, 4, 4), and after each whose model reaches further than what is seen by `more`
    (B,) than `hidden`, two that are slid in `directions` (B, 2) so that either end is the seen
    one's."""
    found = np.empty((len(T) + 2 * np.sum(more > hidden), 4, 4))
    n = 0
    for b in range(len(T)):
        _copy(T[b], found[n])
        n += 1
        if more[b] > hidden:
            for sense in (1, -1):
                _copy(T[b], found[n])
                for axis in range(2):
                    found[n, axis, 3] += sense * more[b] / 2 * directions[b, axis]
                n += 1
    return found


@compiled
def _copy(given: Array, found: Array) -> None:
    """Number by number: to compile `found[:] = given`, with its errors of shapes that differ, takes
    three seconds."""
    for i in range(given.shape[0]):
        for j in range(given.shape[1]):
            found[i, j] = given[i, j]


@compiled
def tops(T: Array, surface: Array, normal: Array) -> Array:
    """How far (B,) a surface (m, 3), placed in each way (B, 4, 4), reaches along a direction."""
    found = np.empty(len(T))
    x, y, z = surface[:, 0].copy(), surface[:, 1].copy(), surface[:, 2].copy()
    for b in range(len(T)):
        along = np.zeros(4)
        for i in range(3):
            along += normal[i] * T[b, i]
        a, c, d = along[0], along[1], along[2]
        most = -np.inf
        for m in range(len(surface)):
            most = max(most, a * x[m] + c * y[m] + d * z[m])
        found[b] = most + along[3]
    return found


@compiled
def _center(T: Array, surface: Array, counts: NDArray[np.bool_], middle: Array) -> None:
    low, high = _reach(T, surface, counts, 1.0, 0.0)
    T[0, 3] += middle[0] - (low + high) / 2
    low, high = _reach(T, surface, counts, 0.0, 1.0)
    T[1, 3] += middle[1] - (low + high) / 2


@compiled
def _reach(
    T: Array, surface: Array, counts: NDArray[np.bool_], x: float, y: float
) -> tuple[float, float]:
    """How far, least and most, the points that count reach in a direction along the plane."""
    a = x * T[0, 0] + y * T[1, 0]
    b = x * T[0, 1] + y * T[1, 1]
    c = x * T[0, 2] + y * T[1, 2]
    low, high = np.inf, -np.inf
    for m in range(len(surface)):
        if counts[m]:
            at = a * surface[m, 0] + b * surface[m, 1] + c * surface[m, 2]
            low, high = min(low, at), max(high, at)
    shift = x * T[0, 3] + y * T[1, 3]
    return low + shift, high + shift
