"""Where the search begins for what rests on nothing that is known: it lies on other objects, or
leans on them."""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import as_transforms
from brrp_cli.registration.initial_poses import resting_initial_poses
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.outline import Footprint, Outline, principal_axes
from brrp_cli.registration.side_loops import facing_boxes, tops

Array = NDArray[np.float64]


def resting_and_leaning(model: ModelGeometry, seen: Outline, config: SearchConfig) -> Array:
    """T_cam_model (B, 4, 4): the model resting on the plane, if there is one, and leaning."""
    resting = np.zeros((0, 4, 4))
    if seen.footprint is not None:
        resting = resting_initial_poses(model, seen.footprint, config)
    return np.concatenate([resting, leaning_poses(model, resting, seen, config)])


def leaning_poses(
    model: ModelGeometry, resting: Array, seen: Outline, config: SearchConfig
) -> Array:
    """T_cam_model (B, 4, 4): resting poses (b, 4, 4) raised to the top of what is seen, principal
    axes laid over those of what is seen, and the model in all ways turned."""
    principal = principal_poses(model, seen)
    turned = np.concatenate([spread_rotations(config.rotations), principal[:, :3, :3]])
    poses = [principal, turned_poses(turned, model, seen, config)]
    if seen.footprint is not None:
        poses.insert(0, raised_poses(resting, model, seen.footprint, config))
    return np.concatenate(poses)


def raised_poses(
    resting: Array, model: ModelGeometry, footprint: Footprint, config: SearchConfig
) -> Array:
    """Those of the resting poses T_cam_model (B, 4, 4) whose top is lower than that of what is seen
    by more than `hidden`, raised to it: an object that lies on others."""
    plane = footprint.plane
    reached = tops(resting, model.surface, plane.normal) + plane.offset
    missing = footprint.top - reached
    lower = missing > config.hidden
    raised = np.asarray(resting[lower])
    raised[:, :3, 3] += missing[lower, None] * plane.normal
    return raised


def principal_poses(model: ModelGeometry, seen: Outline) -> Array:
    """T_cam_model (24, 4, 4) that lay the model's principal axes along those of what is seen, in
    every order and sense, middle on middle: an object that leans on others."""
    own = model.surface.mean(axis=0)
    T = np.tile(np.eye(4), (len(_CUBE), 1, 1))
    T[:, :3, :3] = seen.axes @ _CUBE @ principal_axes(model.surface - own).T
    T[:, :3, 3] = seen.centre - T[:, :3, :3] @ own
    return T


def turned_poses(
    rotations: Array, model: ModelGeometry, seen: Outline, config: SearchConfig
) -> Array:
    """T_cam_model (b, 4, 4) of the model turned in some ways: what leans on others.

    rotations : (b, 3, 3), from the model's axes to the camera's

    The box of the side that faces the camera is laid over the box of what is seen across the line
    of sight, and its nearest point to the nearest one along it.
    """
    nearest, furthest = facing_boxes(
        seen.T_sight_cam @ rotations,
        model.surface[: config.model_points],
        model.normals[: config.model_points],
    )
    # A model none of whose points faces the camera cannot be laid over anything.
    faces = np.isfinite(nearest[:, 0])
    nearest, furthest = nearest[faces], furthest[faces]
    shift = (seen.low + seen.high) / 2 - (nearest + furthest) / 2
    shift[:, 2] = seen.low[2] - nearest[:, 2]
    T = as_transforms(rotations[faces])
    T[:, :3, 3] = shift @ seen.T_sight_cam
    return T


@lru_cache(maxsize=4)
def spread_rotations(count: int) -> Array:
    """(count, 3, 3), spread evenly over all rotations, on super-Fibonacci spirals (Alexa 2022)."""
    if not count:
        return np.zeros((0, 3, 3))
    at = np.arange(count) + 0.5
    inner, outer = np.sqrt(at / count), np.sqrt(1 - at / count)
    first, second = 2 * np.pi * at / np.sqrt(2), 2 * np.pi * at / _PSI
    quaternions = [
        inner * np.sin(first),
        inner * np.cos(first),
        outer * np.sin(second),
        outer * np.cos(second),
    ]
    return np.asarray(Rotation.from_quat(np.stack(quaternions, axis=1)).as_matrix())


# The root of psi^4 = psi + 4.
_PSI = 1.533751168755204288118041


def _rotations_of_a_cube() -> Array:
    """(24, 3, 3)."""
    signed = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]
    return np.stack([matrix for matrix in signed if np.linalg.det(matrix) > 0])


_CUBE = _rotations_of_a_cube()
