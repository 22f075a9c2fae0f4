"""Where the search begins for what rests on nothing that is known: it lies on other objects, or
leans on them."""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import as_transforms, normalise
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.model import ModelGeometry

Array = NDArray[np.float64]


def leaning_poses(
    model: ModelGeometry, resting: Array, seen: Array, plane: Plane | None, config: SearchConfig
) -> Array:
    """T_cam_model (B, 4, 4): resting poses (b, 4, 4) raised to the top of what is seen, principal
    axes laid over those of what is seen, and the model in all ways turned.

    seen : (n, 3) points, metres, camera frame, in random order
    """
    principal = principal_poses(model, seen[: config.box_points])
    turned = np.concatenate([spread_rotations(config.rotations), principal[:, :3, :3]])
    poses = [principal, turned_poses(turned, model, seen, config)]
    if plane is not None:
        poses.insert(0, raised_poses(resting, model, seen, plane, config))
    return np.concatenate(poses)


def raised_poses(
    resting: Array, model: ModelGeometry, seen: Array, plane: Plane, config: SearchConfig
) -> Array:
    """Those of the resting poses T_cam_model (B, 4, 4) whose top is lower than that of the seen
    points (n, 3) by more than `hidden`, raised to it: an object that lies on others."""
    top = np.quantile(plane.signed_distance(seen), 1 - config.stray)
    up = plane.normal @ resting[:, :3, :3]
    reached = (up @ model.surface.T).max(axis=1)
    missing = top - reached - plane.signed_distance(resting[:, :3, 3])
    raised = resting.copy()
    raised[:, :3, 3] += missing[:, None] * plane.normal
    return raised[missing > config.hidden]


def principal_poses(model: ModelGeometry, seen: Array) -> Array:
    """T_cam_model (24, 4, 4) that lay the model's principal axes along those of seen points (n, 3),
    in every order and sense, middle on middle: an object that leans on others."""
    middle, own = seen.mean(axis=0), model.surface.mean(axis=0)
    T = np.tile(np.eye(4), (len(_CUBE), 1, 1))
    T[:, :3, :3] = _axes(seen - middle) @ _CUBE @ _axes(model.surface - own).T
    T[:, :3, 3] = middle - T[:, :3, :3] @ own
    return T


def _axes(points: Array) -> Array:
    """Principal axes (3, 3), the columns, right-handed, of points (n, 3) about their middle."""
    axes = np.linalg.eigh(points.T @ points)[1]
    axes[:, 2] *= np.linalg.det(axes)
    return axes


def turned_poses(
    rotations: Array, model: ModelGeometry, seen: Array, config: SearchConfig
) -> Array:
    """T_cam_model (b, 4, 4) of the model turned in some ways: what leans on others.

    rotations : (b, 3, 3), from the model's axes to the camera's
    seen : (n, 3), metres, camera frame, in random order

    The box of the side that faces the camera is laid over the box of the seen points across the
    line of sight, and its nearest point to theirs along it.
    """
    ahead = normalise(seen.mean(axis=0))
    # Two directions across the line of sight, and it.
    T_sight_cam = np.stack([*np.linalg.svd(ahead[None])[2][1:], ahead])
    low, high = np.quantile(
        seen[: config.box_points] @ T_sight_cam.T, [config.stray, 1 - config.stray], axis=0
    )
    turned = T_sight_cam @ rotations
    placed = turned @ model.surface[: config.model_points].T
    facing = turned[:, 2] @ model.normals[: config.model_points].T < 0
    nearest = np.where(facing[:, None], placed, np.inf).min(axis=-1)
    furthest = np.where(facing[:, None], placed, -np.inf).max(axis=-1)
    shift = (low + high) / 2 - (nearest + furthest) / 2
    shift[:, 2] = low[2] - nearest[:, 2]
    T = as_transforms(rotations)
    T[:, :3, 3] = shift @ T_sight_cam
    # A model none of whose points faces the camera cannot be laid over anything.
    return np.asarray(T[facing.any(axis=1)])


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
