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

Array = NDArray[np.float32]

# Inverse depth of a pixel without any: no surface is so near, so that it agrees with no neighbour.
_MISSING = np.float32(1e6)
# Beyond it float32 holds the Gaussian as a denormal number, which is slow, or not at all.
_FARTHEST = np.float32(80.0)
_BAND = 48


def smooth_depth(depth: NDArray[np.floating], config: SmoothDepthConfig) -> NDArray[np.float64]:
    """Depth (H, W), metres, averaged over what is one surface; NaN, no return, stays NaN."""
    inverse, missing = _inverse(depth)
    scale = np.float32(0.5**0.5) / (2 * _noise(inverse, config))
    for _ in range(config.rounds):
        inverse = _averaged(inverse, scale, config.radius)
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


def _averaged(inverse: Array, scale: Array, radius: int) -> Array:
    """The mean (H, W) of neighbours, by the Gaussian of their difference times scale (H, W)."""
    padded = np.pad(inverse, radius, constant_values=_MISSING)
    averaged = np.empty_like(inverse)
    width = inverse.shape[1]
    # Band by band: what is read and written 48 times stays in the cache.
    for top in range(0, len(inverse), _BAND):
        own, by = inverse[top : top + _BAND], -np.square(scale[top : top + _BAND])
        total, weights = np.zeros_like(own), np.ones_like(own)
        difference, weight = np.empty_like(own), np.empty_like(own)
        for row, column in np.ndindex(2 * radius + 1, 2 * radius + 1):
            if row == radius and column == radius:
                continue
            window = np.s_[top + row : top + row + len(own), column : column + width]
            np.subtract(padded[window], own, out=difference)
            np.square(difference, out=weight)
            np.multiply(weight, by, out=weight)
            np.maximum(weight, -_FARTHEST, out=weight)
            np.exp(weight, out=weight)
            weights += weight
            # Of the difference, which is small: float32 keeps what it means.
            weight *= difference
            total += weight
        averaged[top : top + _BAND] = own + total / weights
    return averaged
