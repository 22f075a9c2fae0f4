"""How well the observed points fix a placement: the covariance of its pose (Laplace
approximation)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SensorConfig
from brrp_cli.geometry import transform_points
from brrp_cli.observation.subsample import grid_subsample
from brrp_cli.registration.model import Model

Array = NDArray[np.float64]


def pose_covariance(
    T_cam_model: Array,
    model: Model,
    observed: NDArray[np.floating],
    wave: float,
    config: SensorConfig,
    others: Sequence[NDArray[np.floating]] = (),
) -> Array:
    """Covariance (6, 6) of a small motion (turn about the model's middle, radians; shift, metres),
    in the camera's axes.

    observed : (n, 3), metres, camera frame. Their means in patches of `config.patch` metres have
    errors of their own, with a standard deviation of `wave` metres: as many pixels as a patch has,
    they are one vote. A motion of `config.pose_turn` and `config.pose_shift` is likely before
    anything was seen.
    others : the same of other views, in this camera's frame: they err independently of this one
    """
    patches = np.concatenate(
        [
            grid_subsample(np.asarray(each, dtype=np.float32), config.patch)
            for each in (observed, *others)
        ]
    )
    local = transform_points(np.linalg.inv(T_cam_model), patches.astype(np.float64))
    distance, gradient = model.distance_and_gradient(local.T.astype(np.float32))
    scale = np.cbrt(np.linalg.det(T_cam_model[:3, :3]))
    normals = gradient.T.astype(np.float64) @ (T_cam_model[:3, :3] / scale).T
    arms = patches.astype(np.float64) - T_cam_model[:3, 3]
    rows = np.concatenate([np.cross(arms, normals), normals], axis=1)
    rows = rows[np.abs(distance) * scale < config.sure * 2 * wave]
    turn, shift = config.pose_turn, config.pose_shift
    prior = np.diag([turn**-2] * 3 + [shift**-2] * 3)
    covariance = np.linalg.inv(rows.T @ rows / wave**2 + prior)
    # What all patches have in common, no number of them averages out.
    covariance[3:, 3:] += config.bias**2 * np.eye(3)
    return np.asarray(covariance)
