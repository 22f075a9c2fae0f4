"""Where the search for an object's pose begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, RegistrationConfig
from brrp_cli.frames.plane import Plane, plane_frame
from brrp_cli.geometry import normalise, similarity, transform_points
from brrp_cli.registration.model import COARSE, Model
from brrp_cli.registration.ransac import match_features
from brrp_cli.registration.scan import ObservedCloud
from brrp_cli.seeds import child_seed

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
    seen = np.asarray(transform_points(T_plane_cam, points))[:, :2]
    middle = np.quantile(seen, [STRAY, 1 - STRAY], axis=0).mean(axis=0)
    camera = T_plane_cam[:3, 3]
    surface, normals = model.surface[:COARSE], model.normals[:COARSE]
    starts = []
    for T_plane_model in model.resting:
        along = _longest(np.asarray(transform_points(T_plane_model, surface), dtype=np.float64))
        for angle in np.arange(turns) * (2 * np.pi / turns):
            T = _turn(angle) @ T_plane_model
            placed = _lay_over(T, np.asarray(transform_points(T, surface)), middle)
            facing = np.einsum("ij,ij->i", camera - placed, normals @ T[:3, :3].T) > 0
            if facing.sum() >= MIN_FACING:
                placed = _lay_over(T, placed[facing], middle)
            starts.append(T_cam_plane @ T)
            direction = _turn(angle)[:2, :2] @ along
            hidden = np.ptp(placed[:, :2] @ direction) - np.ptp(
                np.quantile(seen @ direction, [STRAY, 1 - STRAY])
            )
            if hidden > HIDDEN:
                for shift in (hidden / 2, -hidden / 2):
                    slid = T.copy()
                    slid[:2, 3] += shift * direction
                    starts.append(T_cam_plane @ slid)
    return starts


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
    for number in range(count):
        found = match_features(
            stored.clouds[nearest],
            observed.cloud,
            matching,
            child_seed(seed, "start", stored.name, number),
        )
        if found is not None:
            starts.append(T_cam_center @ found.T_target_source)
    return starts


def _longest(points: Array) -> Array:
    """Unit direction (2,) along the plane in which points (n, 3), plane frame, reach furthest."""
    footprint = points[:, :2]
    return np.asarray(np.linalg.svd(footprint - footprint.mean(axis=0), full_matrices=False)[2][0])


def _turn(angle: float) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    return similarity(rotation=np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]))


def _lay_over(T_plane_model: Array, placed: Array, middle: Array) -> Array:
    """Move the transform, in place, so that the box of `placed` (n, 3) lies over `middle` (2,);
    returns the placed points after it."""
    shift = middle - (placed.min(axis=0) + placed.max(axis=0))[:2] / 2
    T_plane_model[:2, 3] += shift
    return np.asarray(placed + np.append(shift, 0.0))
