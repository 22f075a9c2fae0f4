"""Depth with less noise, for what looks at shapes and not at single points: planes stay planes.

A camera that triangulates (stereo, structured light) has errors of about equal size in inverse
depth, at any distance but the nearest, and a plane is linear in inverse depth over the image. So
inverse depth is averaged, over neighbours that differ by no more than noise does; edges stay where
they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SmoothDepthConfig
from brrp_cli.segmentation.average_loops import averaged

Array = NDArray[np.float32]

# Inverse depth of a pixel without any: no surface is so near, so that it agrees with no neighbour.
_MISSING = np.float32(1e6)


def smooth_depth(depth: NDArray[np.floating], config: SmoothDepthConfig) -> NDArray[np.float64]:
    """Depth (H, W), metres, averaged over what is one surface; NaN, no return, stays NaN."""
    inverse, missing = _inverse(depth)
    scale = np.float32(0.5**0.5) / (2 * _noise(inverse, config))
    for _ in range(config.rounds):
        padded = np.pad(inverse, config.radius, constant_values=_MISSING)
        inverse = averaged(padded, scale, config.radius)
        inverse[missing] = _MISSING
    return np.where(missing, np.nan, 1.0 / inverse.astype(np.float64))


def flying_pixels(depth: NDArray[np.floating], config: SmoothDepthConfig) -> NDArray[np.bool_]:
    """(H, W) bool: pixels that float between surfaces, as a camera makes them at depth edges.

    Such a pixel has few neighbours at its depth: less than a part of those within two pixels
    that have depth, or hardly any.
    depth : (H, W) metres, NaN = no return
    """
    inverse, missing = _inverse(depth)
    limit = np.float32(config.flying_noise) * _noise(inverse, config)
    near = np.zeros(depth.shape, dtype=np.int8)
    valid = np.zeros(depth.shape, dtype=np.int8)
    padded = np.pad(inverse, 2, constant_values=_MISSING)
    there = np.pad(~missing, 2).astype(np.int8)
    height, width = depth.shape
    for row in range(5):
        for column in range(5):
            window = np.s_[row : row + height, column : column + width]
            near += np.abs(padded[window] - inverse) < limit
            valid += there[window]
    few = (near - 1 < config.flying_share * (valid - 1)) | (near < config.flying_least)
    return np.asarray(few & ~missing)


def _inverse(depth: NDArray[np.floating]) -> tuple[Array, NDArray[np.bool_]]:
    """Inverse depth (H, W), and where there is none."""
    inverse = 1.0 / np.asarray(depth, dtype=np.float32)
    missing = ~np.isfinite(inverse)
    inverse[missing] = _MISSING
    return inverse, missing


def _noise(inverse: Array, config: SmoothDepthConfig) -> Array:
    """Deviation of inverse depth (H, W), 1 / metres."""
    return np.maximum(np.float32(config.noise), np.float32(config.floor) * inverse**2)
