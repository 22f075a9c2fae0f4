"""Where the search for an object's pose begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, RegistrationConfig
from brrp_cli.frames.plane import Plane
from brrp_cli.geometry import normalise, similarity, transform_points
from brrp_cli.registration.model import COARSE, Model
from brrp_cli.registration.ransac import match_features
from brrp_cli.registration.scan import ObservedCloud
from brrp_cli.seeds import child_seed

Array = NDArray[np.float64]

# Fewer model points than these facing the camera say nothing about where its seen side ends.
MIN_FACING = 6


def resting_starts(model: Model, points: Array, plane: Plane, turns: int) -> list[Array]:
    """T_cam_model (4, 4) of the model in each resting pose, turned about the plane's normal.

    points : (n, 3) observed, metres, camera frame. Along the plane, the box of the model's side
    that faces the camera is laid over the box of the observed points.
    """
    T_plane_cam = plane_frame(plane)
    T_cam_plane = np.linalg.inv(T_plane_cam)
    seen = transform_points(T_plane_cam, points)
    middle = (seen.min(axis=0) + seen.max(axis=0))[:2] / 2
    camera = T_plane_cam[:3, 3]
    surface, normals = model.surface[:COARSE], model.normals[:COARSE]
    starts = []
    for T_plane_model in model.resting:
        for angle in np.arange(turns) * (2 * np.pi / turns):
            T = _turn(angle) @ T_plane_model
            placed = _lay_over(T, np.asarray(transform_points(T, surface)), middle)
            facing = np.einsum("ij,ij->i", camera - placed, normals @ T[:3, :3].T) > 0
            if facing.sum() >= MIN_FACING:
                _lay_over(T, placed[facing], middle)
            starts.append(T_cam_plane @ T)
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


def plane_frame(plane: Plane) -> Array:
    """T_plane_cam (4, 4): z along the plane's normal, z = 0 on the plane; x and y arbitrary but
    always the same."""
    helper = np.eye(3)[np.argmin(np.abs(plane.normal))]
    x = normalise(np.cross(plane.normal, helper))
    rotation = np.stack([x, np.cross(plane.normal, x), plane.normal])
    return similarity(rotation=rotation, translation=np.array([0, 0, plane.offset]))


def _turn(angle: float) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    return similarity(rotation=np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]))


def _lay_over(T_plane_model: Array, placed: Array, middle: Array) -> Array:
    """Move the transform, in place, so that the box of `placed` (n, 3) lies over `middle` (2,);
    returns the placed points after it."""
    shift = middle - (placed.min(axis=0) + placed.max(axis=0))[:2] / 2
    T_plane_model[:2, 3] += shift
    return np.asarray(placed + np.append(shift, 0.0))
