"""Where one thing ends and another begins: jumps of depth, and creases that are hollow.

What touches meets in a hollow crease (Stein et al., Object Partitioning using Local Convexity,
CVPR 2014): a can on a table, two boxes side by side. Within one thing hollow creases are rarer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import ConcaveEdgesConfig
from brrp_cli.segmentation.crease_loops import hollow_cosines

Array = NDArray[np.floating]


def surface_normals(points: Array, config: ConcaveEdgesConfig) -> Array:
    """Unit normals (H, W, 3), toward the camera, of points (H, W, 3); NaN beside missing ones."""
    step = config.normal_step
    padded = np.pad(points, ((step, step), (step, step), (0, 0)), constant_values=np.nan)
    across = padded[step:-step, 2 * step :] - padded[step:-step, : -2 * step]
    down = padded[2 * step :, step:-step] - padded[: -2 * step, step:-step]
    normals = np.empty_like(down)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        normals[..., i] = down[..., j] * across[..., k] - down[..., k] * across[..., j]
    with np.errstate(invalid="ignore", divide="ignore"):
        normals /= np.sqrt(_dot(normals, normals))[..., None]
    return normals


def hollow_creases(points: Array, normals: Array, config: ConcaveEdgesConfig) -> Array:
    """(H, W) from 0, none, to 1, a sharp hollow crease of points (H, W, 3), metres, at the pixel.

    normals : (H, W, 3) unit, toward the camera
    """
    return strength(hollow_angles(points, normals, config), config.flat, config.sharp)


def strength(angles: Array, flat: float, sharp: float) -> Array:
    """Creases (H, W) from 0, at `flat` degrees and less, to 1, at `sharp` and more."""
    return np.clip((angles - flat) / (sharp - flat), 0.0, 1.0)


def hollow_angles(points: Array, normals: Array, config: ConcaveEdgesConfig) -> Array:
    """(H, W) degrees by which the surface of points (H, W, 3), metres, bends toward the camera, 0
    where it is flat or bends away.

    normals : (H, W, 3) unit, toward the camera
    """
    reach = config.reach
    ways = np.array([(0, reach), (reach, 0), (3, 3), (3, -3)])
    least = hollow_cosines(
        np.ascontiguousarray(points, np.float32),
        np.ascontiguousarray(normals, np.float32),
        ways,
        config.near,
    )
    angles = np.zeros(least.shape)
    bends = least < 1
    angles[bends] = np.degrees(np.arccos(np.clip(least[bends].astype(np.float64), -1, 1)))
    return angles


def _dot(first: Array, second: Array) -> Array:
    """Of vectors (..., 3)."""
    found = first[..., 0] * second[..., 0]
    found += first[..., 1] * second[..., 1]
    found += first[..., 2] * second[..., 2]
    return np.asarray(found)


def depth_jumps(depth: Array, K: Array, config: ConcaveEdgesConfig) -> NDArray[np.bool_]:
    """(H, W) pixels beside which depth (H, W), metres, jumps: steeper than a surface is seen."""
    allowed = []
    for axis, focal in ((0, K[1, 1]), (1, K[0, 0])):
        near = np.moveaxis(depth, axis, 0)
        width = np.minimum(near[1:], near[:-1]) / focal
        allowed.append(np.maximum(config.steep * width, config.jump))
    return depth_steps(depth, allowed)


def depth_steps(depth: Array, allowed: Sequence[Array | float]) -> NDArray[np.bool_]:
    """(H, W) pixels from which depth (H, W), metres, changes to the next one by more than is
    allowed: metres (H - 1, W) down and (W - 1, H) across, or one number each."""
    steps = np.zeros(depth.shape, dtype=bool)
    for axis, most in enumerate(allowed):
        near, marked = np.moveaxis(depth, axis, 0), np.moveaxis(steps, axis, 0)
        with np.errstate(invalid="ignore"):
            steep = np.abs(near[1:] - near[:-1]) > most
        marked[1:] |= steep
        marked[:-1] |= steep
    return steps
