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
from brrp_cli.registration.seen_mask import SeenMask

Array = NDArray[np.float64]


def pose_covariance(
    T_cam_model: Array,
    model: Model,
    observed: NDArray[np.floating],
    wave: float,
    config: SensorConfig,
    others: Sequence[NDArray[np.floating]] = (),
    mask: SeenMask | None = None,
) -> Array:
    """Covariance (6, 6) of a small motion (turn about the model's middle, radians; shift, metres),
    in the camera's axes.

    observed : (n, 3), metres, camera frame. Their means in patches of `config.patch` metres have
    errors of their own, with a standard deviation of `wave` metres: as many pixels as a patch has,
    they are one vote. A motion of `config.pose_turn` and `config.pose_shift` is likely before
    anything was seen.
    others : the same of other views, in this camera's frame: they err independently of this one
    mask : of the object, where depth shows too little of it: how far away it stands is then
        supposed rather than seen
    """
    trust = 1.0 if mask is None else mask.trust
    views = [
        grid_subsample(np.asarray(each, dtype=np.float32), config.patch)
        for each in (observed, *others)
    ]
    counted = np.repeat([trust, *(1.0 for _ in others)], [len(each) for each in views])
    patches = np.concatenate(views)
    local = transform_points(np.linalg.inv(T_cam_model), patches.astype(np.float64))
    distance, gradient = model.distance_and_gradient(local.T.astype(np.float32))
    scale = np.cbrt(np.linalg.det(T_cam_model[:3, :3]))
    normals = gradient.T.astype(np.float64) @ (T_cam_model[:3, :3] / scale).T
    arms = patches.astype(np.float64) - T_cam_model[:3, 3]
    rows = np.concatenate([np.cross(arms, normals), normals], axis=1)
    near = np.abs(distance) * scale < config.sure * 2 * wave
    rows = rows[near] * np.sqrt(counted[near])[:, None]
    turn, shift = config.pose_turn, config.pose_shift
    known = rows.T @ rows / wave**2
    if mask is not None:
        shift = float(np.hypot(shift, (1 - trust) * mask.config.supposed))
        middle = T_cam_model[:3, 3]
        _, edges = mask.edges.gaps(T_cam_model, model.surface, middle)
        known += edges.T @ edges / mask.edges.deviation**2
    prior = np.diag([turn**-2] * 3 + [shift**-2] * 3)
    covariance = np.linalg.inv(known + prior)
    # What all patches have in common, no number of them averages out.
    covariance[3:, 3:] += config.bias**2 * np.eye(3)
    return np.asarray(covariance)
