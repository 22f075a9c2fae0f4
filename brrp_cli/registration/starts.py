"""Where the search for an object's pose begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, RegistrationConfig
from brrp_cli.frames.plane import Plane, plane_frame
from brrp_cli.geometry import normalise, similarity, transform_points
from brrp_cli.registration.draws import drawn_motions
from brrp_cli.registration.model import COARSE, Model
from brrp_cli.registration.ransac import match_pairs
from brrp_cli.registration.scan import ObservedCloud
from brrp_cli.seeds import child_rng

Array = NDArray[np.float64]

# Fewer model points than these facing the camera say nothing about where its seen side ends.
MIN_FACING = 6
# Points at the edge of a mask may be of what lies behind: so many of each side are left out of the
# box of what is seen.
STRAY = 0.02
# Metres by which the model's visible side must be longer than what is seen of it before the seen
# part is taken for either end of it too.
HIDDEN = 0.015


def resting_starts(model: Model, points: Array, plane: Plane, turns: int) -> list[Array]:
    """T_cam_model (4, 4) of the model in each resting pose, turned about the plane's normal.

    points : (n, 3) observed, metres, camera frame. Along the plane, the box of the model's side
    that faces the camera is laid over the box of the observed points. Where that side is longer
    than what is seen, a part of it is hidden, and what is seen is laid over each of its ends too.
    """
    T_plane_cam = plane_frame(plane)
    T_cam_plane = np.linalg.inv(T_plane_cam)
    seen: Array = np.asarray(transform_points(T_plane_cam, points), dtype=np.float64)[:, :2]
    middle = np.quantile(seen, [STRAY, 1 - STRAY], axis=0).mean(axis=0)
    turned = [_turn(angle) for angle in np.arange(turns) * (2 * np.pi / turns)]
    starts = []
    for T_plane_model in model.resting:
        T = np.stack(turned) @ T_plane_model
        placed, counted = _laid_over(T, model, middle, T_plane_cam[:3, 3])
        directions = np.asarray(np.stack(turned)[:, :2, :2] @ _longest(T_plane_model, model))
        reach = np.einsum("bmi,bi->bm", placed[..., :2], directions)
        longest = np.where(counted, reach, -np.inf).max(axis=1)
        longest -= np.where(counted, reach, np.inf).min(axis=1)
        hidden = longest - _extents(seen, directions)
        for each, direction, more in zip(T, directions, hidden, strict=True):
            starts.append(T_cam_plane @ each)
            if more > HIDDEN:
                for shift in (more / 2, -more / 2):
                    slid = each.copy()
                    slid[:2, 3] += shift * direction
                    starts.append(T_cam_plane @ slid)
    return starts


def _laid_over(
    T_plane_model: Array, model: Model, middle: Array, camera: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Move transforms (B, 4, 4), in place, so that the box of the side that faces the camera (3,)
    lies over `middle` (2,); returns the placed points (B, m, 3) and which count as that side.

    Which side faces the camera is found with the whole model laid over `middle`.
    """
    linear = T_plane_model[:, :3, :3]
    placed = model.surface[:COARSE] @ linear.mT + T_plane_model[:, None, :3, 3]
    counted = np.ones(placed.shape[:2], dtype=bool)
    _lay_over(T_plane_model, placed, counted, middle)
    normals = model.normals[:COARSE] @ linear.mT
    facing = np.einsum("bmi,bmi->bm", camera - placed, normals) > 0
    enough = facing.sum(axis=1) >= MIN_FACING
    counted[enough] = facing[enough]
    _lay_over(T_plane_model, placed, counted, middle)
    return placed, counted


def matched_starts(
    model: Model,
    observed: ObservedCloud,
    features: FeatureConfig,
    matching: RegistrationConfig,
    count: int,
    seed: int,
) -> list[Array]:
    """T_cam_model (4, 4) of up to `count` feature matchings at the stored size nearest to the true
    one, and the model unturned just behind its seen front: what has no features to match, a ball,
    needs no turning either."""
    stored = model.stored
    nearest = min(
        features.scales,
        key=lambda scale: abs(np.log(scale * features.base_scale / stored.half_extent)),
    )
    T_cam_center = similarity(translation=observed.center)
    behind = normalise(observed.center) * np.ptp(model.surface, axis=0).mean() / 4
    starts = [T_cam_center @ similarity(translation=behind)]
    cloud = stored.clouds[nearest]
    pairs = match_pairs(cloud, observed.cloud)
    rng = child_rng(seed, "starts", stored.name)
    found = drawn_motions(
        cloud.points[pairs[:, 0]], observed.cloud.points[pairs[:, 1]], matching, count, rng
    )
    starts += [T_cam_center @ T_center_model for T_center_model in found]
    return starts


def _longest(T_plane_model: Array, model: Model) -> Array:
    """Unit direction (2,) along the plane in which the model reaches furthest."""
    points = transform_points(T_plane_model, model.surface[:COARSE])
    footprint = np.asarray(points, dtype=np.float64)[:, :2]
    return np.asarray(np.linalg.svd(footprint - footprint.mean(axis=0), full_matrices=False)[2][0])


def _extents(seen: Array, directions: Array) -> Array:
    """How far points (n, 2) reach in each direction (b, 2), without strays."""
    # Back is as far as forth.
    half = len(directions) // 2 if len(directions) % 2 == 0 else len(directions)
    found = np.ptp(np.quantile(directions[:half] @ seen.T, [STRAY, 1 - STRAY], axis=1), axis=0)
    return np.tile(found, len(directions) // half)


def _turn(angle: float) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    return similarity(rotation=np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]))


def _lay_over(
    T_plane_model: Array, placed: Array, counted: NDArray[np.bool_], middle: Array
) -> None:
    """Move transforms (B, 4, 4) and placed points (B, m, 3), in place, so that the box of the
    points that count (B, m) lies over `middle` (2,)."""
    along = placed[..., :2]
    high = np.where(counted[..., None], along, -np.inf).max(axis=1)
    low = np.where(counted[..., None], along, np.inf).min(axis=1)
    shift = middle - (low + high) / 2
    T_plane_model[:, :2, 3] += shift
    along += shift[:, None]
