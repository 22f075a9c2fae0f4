"""Where the search for an object's pose begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, RegistrationConfig, SearchConfig
from brrp_cli.geometry import normalise, similarity, transform_points
from brrp_cli.observation.support_plane import Plane, plane_frame
from brrp_cli.registration.batched_ransac import ransac_motions
from brrp_cli.registration.model import Model, ModelGeometry
from brrp_cli.registration.ransac import match_pairs
from brrp_cli.registration.scale_scan import ObservedCloud
from brrp_cli.seeds import child_rng

Array = NDArray[np.float64]


def resting_initial_poses(
    model: ModelGeometry, points: Array, plane: Plane, config: SearchConfig
) -> Array:
    """T_cam_model (B, 4, 4) of the model in each resting pose, turned about the plane's normal.

    points : (n, 3) observed, metres, camera frame, in random order. Along the plane, the box of
    the model's side that faces the camera is laid over the box of the observed points. Where that
    side is longer than what is seen, a part of it is hidden, and what is seen is laid over each of
    its ends too.
    """
    if not model.resting:
        return np.zeros((0, 4, 4))
    T_plane_cam = plane_frame(plane)
    seen: Array = np.asarray(
        transform_points(T_plane_cam, points[: config.box_points]), dtype=np.float64
    )[:, :2]
    middle = np.quantile(seen, [config.stray, 1 - config.stray], axis=0).mean(axis=0)
    turned = np.stack(
        [_turn(angle) for angle in np.arange(config.turns) * (2 * np.pi / config.turns)]
    )
    resting = np.stack(model.resting)
    T = (turned @ resting[:, None]).reshape(-1, 4, 4)
    counted = _laid_over(T, model, middle, T_plane_cam[:3, 3], config)
    longest = np.stack([_longest(T_plane_model, model, config) for T_plane_model in resting])
    directions = (turned[:, :2, :2] @ longest[:, None, :, None])[..., 0].reshape(-1, 2)
    low, high = _reach(T, directions, counted, model, config)
    more = high - low - _extents(seen, directions, config)
    longer = np.flatnonzero(more > config.hidden)
    way = more[longer, None] / 2 * directions[longer]
    ends = np.concatenate([T[longer], T[longer]])
    ends[:, :2, 3] += np.concatenate([way, -way])
    # Each is followed by itself over either end.
    order = np.argsort(np.concatenate([np.arange(len(T)), longer, longer]), kind="stable")
    return np.asarray(np.linalg.inv(T_plane_cam) @ np.concatenate([T, ends])[order])


def _laid_over(
    T_plane_model: Array, model: ModelGeometry, middle: Array, camera: Array, config: SearchConfig
) -> NDArray[np.bool_]:
    """Move transforms (B, 4, 4), in place, so that the box of the side that faces the camera (3,)
    lies over `middle` (2,); returns which points (B, m) count as that side.

    Which side faces the camera is found with the whole model laid over `middle`.
    """
    surface = model.surface[: config.model_points]
    normals = model.normals[: config.model_points]
    counted = np.ones((len(T_plane_model), len(surface)), dtype=bool)
    _lay_over(T_plane_model, counted, middle, model, config)
    # In the model's axes, where its normals are the same for all placements.
    camera_in_model = (camera - T_plane_model[:, None, :3, 3]) @ T_plane_model[:, :3, :3]
    facing = camera_in_model[:, 0] @ normals.T > (surface * normals).sum(axis=1)
    enough = facing.sum(axis=1) >= config.least_facing
    counted[enough] = facing[enough]
    _lay_over(T_plane_model, counted, middle, model, config)
    return counted


def _lay_over(
    T_plane_model: Array,
    counted: NDArray[np.bool_],
    middle: Array,
    model: ModelGeometry,
    config: SearchConfig,
) -> None:
    """Move transforms (B, 4, 4), in place, so that the box of the points that count (B, m) lies
    over `middle` (2,)."""
    for axis, direction in enumerate(np.eye(2)):
        low, high = _reach(T_plane_model, direction, counted, model, config)
        T_plane_model[:, axis, 3] += middle[axis] - (low + high) / 2


def _reach(
    T_plane_model: Array,
    directions: Array,
    counted: NDArray[np.bool_],
    model: ModelGeometry,
    config: SearchConfig,
) -> tuple[Array, Array]:
    """How far, least and most (B,), the model's points that count (B, m) reach in directions
    (B, 2) or (2,) along the plane."""
    toward = np.broadcast_to(directions, (len(T_plane_model), 2))
    in_model = np.einsum("bi,bij->bj", toward, T_plane_model[:, :2, :3])
    along = in_model @ model.surface[: config.model_points].T
    shift = np.einsum("bi,bi->b", toward, T_plane_model[:, :2, 3])
    low = np.where(counted, along, np.inf).min(axis=1)
    high = np.where(counted, along, -np.inf).max(axis=1)
    return low + shift, high + shift


def feature_matched_poses(
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
    found = ransac_motions(
        cloud.points[pairs[:, 0]], observed.cloud.points[pairs[:, 1]], matching, count, rng
    )
    starts += [T_cam_center @ T_center_model for T_center_model in found]
    return starts


def _longest(T_plane_model: Array, model: ModelGeometry, config: SearchConfig) -> Array:
    """Unit direction (2,) along the plane in which the model reaches furthest."""
    points = transform_points(T_plane_model, model.surface[: config.model_points])
    footprint = np.asarray(points, dtype=np.float64)[:, :2]
    return np.asarray(np.linalg.svd(footprint - footprint.mean(axis=0), full_matrices=False)[2][0])


def _extents(seen: Array, directions: Array, config: SearchConfig) -> Array:
    """How far points (n, 2) reach in each direction (b, 2), without strays."""
    return np.ptp(
        np.quantile(directions @ seen.T, [config.stray, 1 - config.stray], axis=1), axis=0
    )


def _turn(angle: float) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    return similarity(rotation=np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]))
