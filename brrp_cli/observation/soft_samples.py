"""Observed samples with the probability that each is occupied, given how far the sensor errs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from brrp_cli.config import SensorConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.observation.sensor_noise import depth_deviation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SoftSamples:
    """points : (n, 3), metres, camera frame; targets : (n,) probability of being occupied;
    measured : (n, 3), the point of the seen surface that a sample comes from, NaN for free
    space."""

    points: Array
    targets: Array
    measured: Array


NO_SAMPLES = SoftSamples(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))


def soft_samples(
    observation: ObjectObservation, frame: Frame, distance: float, config: SensorConfig
) -> SoftSamples:
    """What an observation says of occupied and free space.

    The seen surface is sampled `distance` metres in front of and behind of where it was measured:
    the measurement itself is as much outside as inside. A free sample that lies a few standard
    deviations in front of the measured depth is free for certain; at the measured depth, it may be
    either. Another object's surface is moved behind, where it is that object's.
    """
    points = np.asarray(observation.samples, dtype=np.float64)
    seen, free = points[observation.labels], points[~observation.labels]
    sure = ndtr(distance / depth_deviation(seen[:, 2], config))
    gap = depth_behind(free, frame)
    measured = np.abs(np.nan_to_num(gap, nan=np.inf)) < config.sure * depth_deviation(
        free[:, 2], config
    )
    mask = at_pixels(free, frame.segmap, frame)
    others = measured & (mask != BACKGROUND) & (mask != observation.object_id)
    free = np.concatenate([_along(free[others], distance), free[~measured]])
    return SoftSamples(
        points=np.concatenate([_along(seen, distance), _along(seen, -distance), free]),
        targets=np.concatenate([sure, 1 - sure, np.zeros(len(free))]),
        measured=np.concatenate([seen, seen, np.full_like(free, np.nan)]),
    )


def _along(points: Array, distance: float) -> Array:
    """Points (n, 3) moved away from the camera by `distance` metres."""
    return points * (1 + distance / np.linalg.norm(points, axis=1, keepdims=True))
