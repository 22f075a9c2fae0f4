"""How well each of many models can be placed on what is seen: the search of pose_search.py, cut
short.

The search looks for the pose to within a millimetre. Here only the alignment score is asked for,
which tells models apart long before that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import as_transforms, normalise
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.initial_poses import resting_initial_poses
from brrp_cli.registration.model import ModelGeometry
from brrp_cli.registration.sdf_refinement import refine_to_sdf
from brrp_cli.registration.verification import Verifier

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FirstPlacements:
    """T_cam_model (B, 4, 4), the most promising placements of a model, unrefined, and the score of
    the best, 1 at best."""

    T_cam_model: Array
    score: float


@dataclass(frozen=True)
class Aligned:
    """T_cam_model (B, 4, 4), refined placements of a model, best first, and the score of the best,
    1 at best."""

    T_cam_model: Array
    score: float


def aligned(
    models: Sequence[ModelGeometry],
    placements: Sequence[FirstPlacements],
    verifier: Verifier,
    config: SearchConfig,
) -> list[Aligned]:
    """How well each model can be placed, from its first placements.

    All are refined coarsely; those that stay `beaten` behind the best of them are not refined
    further. Scores are compared with `seen_points` observed points, at last with `fine_points`.
    """
    found = [
        _coarse(model, first, verifier, config)
        for model, first in zip(models, placements, strict=True)
    ]
    best = max((each.score for each in found), default=-np.inf)
    return [
        finely(each, model, verifier, config) if each.score >= best - config.beaten else each
        for each, model in zip(found, models, strict=True)
    ]


def finely(
    placed: Aligned, model: ModelGeometry, verifier: Verifier, config: SearchConfig
) -> Aligned:
    """The `fine` best placements, refined with `fine_points`."""
    points = config.fine_points
    T = _refined(
        placed.T_cam_model[: config.fine],
        model,
        verifier,
        points,
        config.fine_distance,
        config.fine_steps,
    )
    return _best_first(T, _scores(T, model, verifier, config, points))


def first_placements(
    model: ModelGeometry, verifier: Verifier, config: SearchConfig
) -> FirstPlacements:
    """The `coarse` best of all ways to lay a model over what is seen, on a plane that `verifier`
    must have: resting, raised, leaning."""
    assert verifier.plane is not None
    resting = resting_initial_poses(model, verifier.points, verifier.plane, config)
    principal = principal_poses(model, verifier.points[: config.box_points])
    turned = np.concatenate([spread_rotations(config.rotations), principal[:, :3, :3]])
    T = np.concatenate(
        [
            resting,
            raised_poses(resting, model, verifier.points, verifier.plane, config),
            principal,
            turned_poses(turned, model, verifier.points, config),
        ]
    )
    score = _scores(T, model, verifier, config, config.seen_points // config.first_share)
    order = np.argsort(-score, kind="stable")[: config.coarse]
    return FirstPlacements(np.asarray(T[order]), float(score[order[0]]))


def _coarse(
    model: ModelGeometry, first: FirstPlacements, verifier: Verifier, config: SearchConfig
) -> Aligned:
    """The first placements after a coarse refinement."""
    T = _refined(
        first.T_cam_model,
        model,
        verifier,
        config.coarse_points,
        config.coarse_distance,
        config.coarse_steps,
    )
    return _best_first(T, _scores(T, model, verifier, config, config.seen_points))


def _best_first(T_cam_model: Array, score: Array) -> Aligned:
    order = np.argsort(-score, kind="stable")
    return Aligned(np.asarray(T_cam_model[order]), float(score[order[0]]))


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


def _scores(
    T_cam_model: Array, model: ModelGeometry, verifier: Verifier, config: SearchConfig, points: int
) -> Array:
    return verifier.score(
        T_cam_model, model, config.alignment_score, model_points=points, seen_points=points
    )


def _refined(
    T_cam_model: Array,
    model: ModelGeometry,
    verifier: Verifier,
    points: int,
    distance: float,
    steps: int,
) -> Array:
    T_model_cam = np.asarray(np.linalg.inv(T_cam_model), dtype=np.float64)
    seen = verifier.points[:points]
    return np.asarray(np.linalg.inv(refine_to_sdf(T_model_cam, seen, model, distance, steps)))
