"""Depth with less noise, for what looks at shapes and not at single points: planes stay planes.

A camera that triangulates (stereo, structured light) has errors of about equal size in inverse
depth, at any distance but the nearest, and a plane is linear in inverse depth over the image. So
inverse depth is averaged, over neighbours that differ by no more than noise does; edges stay where
they are.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SmoothDepthConfig

Array = NDArray[np.float64]


def smooth_depth(depth: NDArray[np.floating], config: SmoothDepthConfig) -> Array:
    """Depth (H, W), metres, averaged over what is one surface; NaN, no return, stays NaN."""
    inverse = 1.0 / np.asarray(depth, dtype=np.float64)
    noise = _noise(inverse, config)
    for _ in range(config.rounds):
        inverse = _averaged(inverse, noise, config.radius)
    return 1.0 / inverse


def flying_pixels(depth: NDArray[np.floating], config: SmoothDepthConfig) -> NDArray[np.bool_]:
    """(H, W) bool: pixels that float between surfaces, as a camera makes them at depth edges.

    Such a pixel has few neighbours at its depth: less than a part of those within two pixels
    that have depth, or hardly any.
    depth : (H, W) metres, NaN = no return
    """
    inverse = 1.0 / np.asarray(depth, dtype=np.float64)
    noise = _noise(inverse, config)
    near = np.zeros(depth.shape)
    valid = np.zeros(depth.shape)
    padded = np.pad(inverse, 2, constant_values=np.nan)
    for shifted in _shifted(padded, 2, depth.shape):
        with np.errstate(invalid="ignore"):
            near += np.abs(shifted - inverse) < config.flying_noise * noise
        valid += np.isfinite(shifted)
    few = (near - 1 < config.flying_share * (valid - 1)) | (near < config.flying_least)
    return np.asarray(few & np.isfinite(inverse))


def _noise(inverse: Array, config: SmoothDepthConfig) -> Array:
    """Deviation of inverse depth (H, W), 1 / metres."""
    return np.maximum(config.noise, config.floor * inverse**2)


def _averaged(inverse: Array, noise: Array, radius: int) -> Array:
    total = np.zeros(inverse.shape)
    weights = np.zeros(inverse.shape)
    padded = np.pad(inverse, radius, constant_values=np.nan)
    for shifted in _shifted(padded, radius, inverse.shape):
        with np.errstate(invalid="ignore"):
            weight = np.exp(-0.5 * ((shifted - inverse) / (2 * noise)) ** 2)
        weight[~np.isfinite(weight)] = 0.0
        total += weight * np.where(weight > 0, shifted, 0.0)
        weights += weight
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(inverse), total / np.maximum(weights, 1e-12), np.nan)


def _shifted(padded: Array, radius: int, shape: tuple[int, ...]) -> Iterator[Array]:
    """Every neighbour within `radius` pixels, itself among them, as images of `shape`."""
    for row in range(2 * radius + 1):
        for column in range(2 * radius + 1):
            yield padded[row : row + shape[0], column : column + shape[1]]
