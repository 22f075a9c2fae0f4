"""Point-to-SDF refinement of many placements at once: observed points come onto the surface.

Gauss-Newton on the sum of squared signed distances, which a grid holds: point-to-plane ICP
without a search for the nearest point, whose plane is that of the surface and not of a sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.registration.model import ModelGeometry

Array = NDArray[np.float64]

# Placements that turn (radians) and move (metres) by less in a step stand still: a tenth of what a
# depth camera can tell.
STILL = 1e-4
# Of the mean diagonal: what is not seen of a ball's turn is not turned.
DAMPING = 1e-6
# A step changes the size by this share at most.
MOST_RESIZED = 0.1


def refine_to_sdf(
    T_model_cam: Array,
    observed: Array,
    model: ModelGeometry,
    distance: float,
    iterations: int,
    *,
    resize: bool = False,
) -> Array:
    """T_model_cam (B, 4, 4), similarities, each followed by the rigid motion that brings observed
    points (n, 3), metres, camera frame, onto the model's surface; with `resize`, by a change of
    size too.

    distance : points further from it than that, metres of the model, do not pull
    iterations : steps at most; a placement that stands still is left alone before
    """
    T = T_model_cam.copy()
    moving = np.arange(len(T))
    for _ in range(iterations):
        # The axis comes first: long contiguous rows are what NumPy is fast on.
        points = T[moving, :3, :3].swapaxes(0, 1) @ observed.T
        points += T[moving, :3, 3].T[..., None]
        step = _step(points.astype(np.float32), model, distance, resize)
        T[moving] = _motion(step) @ T[moving]
        moving = moving[np.abs(step).max(axis=1) > STILL]
        if not len(moving):
            break
    return T


def _step(
    points: NDArray[np.float32], model: ModelGeometry, distance: float, resize: bool
) -> Array:
    """Turn, shift and change of log size (B, 7), about the model's middle, of points (3, B, n)."""
    _, batch, count = points.shape
    value, slope = model.distance_and_gradient(points.reshape(3, -1))
    pulls = np.abs(value) < distance
    slope *= pulls
    p, along = points, slope.reshape(points.shape)
    unknowns = 7 if resize else 6
    rows = np.empty((batch, unknowns, count), np.float32)
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(p[j], along[k], out=rows[:, i])
        rows[:, i] -= p[k] * along[j]
    rows[:, 3:6] = along.swapaxes(0, 1)
    if resize:
        # Distances count in metres of the camera frame: in the model's, which shrink as it is taken
        # to be larger, every noise would make it so.
        rows[:, 6] = (p * along).sum(axis=0) - (value * pulls).reshape(batch, count)
    normal = (rows @ rows.mT).astype(np.float64)
    fall = rows @ value.reshape(batch, count, 1)
    trace = np.einsum("bii->b", normal)[:, None, None]
    # Nothing pulls where the trace is 0.
    normal += (DAMPING * trace / unknowns + (trace == 0)) * np.eye(unknowns)
    step = np.zeros((batch, 7))
    step[:, :unknowns] = -np.linalg.solve(normal, fall.astype(np.float64))[..., 0]
    step[:, 6] = np.clip(step[:, 6], -MOST_RESIZED, MOST_RESIZED)
    return step


def _motion(step: Array) -> Array:
    """(B, 4, 4) that turns by step[:, :3] (Rodrigues), shifts by step[:, 3:6] and resizes by
    exp(step[:, 6])."""
    angle = np.sqrt(np.square(step[:, :3]).sum(axis=1))
    x, y, z = step[:, :3].T / np.maximum(angle, 1e-12)
    K = np.zeros((len(step), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -z, y, -x
    K[:, 1, 0], K[:, 2, 0], K[:, 2, 1] = z, -y, x
    sine, versine = np.sin(angle), 1 - np.cos(angle)
    T = np.zeros((len(step), 4, 4))
    turn = sine[:, None, None] * K + versine[:, None, None] * (K @ K) + np.eye(3)
    T[:, :3, :3] = turn * np.exp(step[:, 6])[:, None, None]
    T[:, :3, 3] = step[:, 3:6]
    T[:, 3, 3] = 1
    return T
