"""How far measured depth errs, and how much of that many pixels have in common.

Single pixels err independently of one another, which averages out. What a camera gets wrong over
centimetres, its waves and steps, does not, however many pixels see it. The support plane is flat,
so that what depth shows of waves on it is measured in every frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SensorConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.last_frame import kept_for_last_frame
from brrp_cli.geometry import cells_of, lengths
from brrp_cli.observation.support_plane import Plane, plane_frame

Array = NDArray[np.float64]

# Of normally distributed numbers the median absolute value is so much of the standard deviation.
MEDIAN_ABSOLUTE = 0.6745


def depth_deviation(depth: NDArray[np.floating], config: SensorConfig) -> Array:
    """Standard deviation (n,), metres, of depth measured at depths (n,), metres."""
    return np.asarray(config.noise + config.noise_growth * np.asarray(depth, np.float64) ** 2)


@kept_for_last_frame
def wave_deviation(frame: Frame, plane: Plane | None, config: SensorConfig) -> float:
    """Standard deviation, metres, of the mean depth of a patch `config.patch` metres wide: what
    waves and steps make of the table, along the camera's rays. `config.wave` at least, and where
    there is no table."""
    if plane is None:
        return config.wave
    points = frame.points[frame.valid & (frame.segmap == BACKGROUND)].astype(np.float64)
    height = plane.signed_distance(points)
    near = np.abs(height) < config.table_reach
    points, height = points[near], height[near]
    along = points @ plane.normal / lengths(points)
    on_plane = points @ plane_frame(plane)[:2, :3].T
    cell = cells_of(on_plane, config.patch)
    count = np.bincount(cell)
    error = height / np.maximum(np.abs(along), 0.1)
    mean = np.bincount(cell, error) / count
    whole = mean[count >= config.patch_points]
    if len(whole) < config.least_patches:
        return config.wave
    spread = np.median(np.abs(whole - np.median(whole))) / MEDIAN_ABSOLUTE
    return float(max(spread, config.wave))
