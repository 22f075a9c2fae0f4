"""Where the search for an object's pose begins."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, RegistrationConfig, SearchConfig
from brrp_cli.geometry import normalise, similarity
from brrp_cli.registration.batched_ransac import ransac_motions
from brrp_cli.registration.model import Model, ModelGeometry
from brrp_cli.registration.outline import Footprint
from brrp_cli.registration.ransac import match_pairs
from brrp_cli.registration.scale_scan import ObservedCloud
from brrp_cli.registration.side_loops import lay_over, with_ends
from brrp_cli.seeds import child_rng

Array = NDArray[np.float64]


def resting_initial_poses(
    model: ModelGeometry, footprint: Footprint, config: SearchConfig
) -> Array:
    """T_cam_model (B, 4, 4) of the model in each resting pose, turned about the plane's normal.

    Along the plane, the box of the model's side that faces the camera is laid over the box of what
    is seen. Where that side is longer than what is seen, a part of it is hidden, and what is seen
    is laid over each of its ends too.
    """
    if not model.resting:
        return np.zeros((0, 4, 4))
    turned = turns(config.turns)
    resting = np.stack(model.resting)
    T = (turned @ resting[:, None]).reshape(-1, 4, 4)
    surface = model.surface[: config.model_points]
    longest = _longest(resting, surface)
    directions = (turned[:, :2, :2] @ longest[:, None, :, None])[..., 0].reshape(-1, 2)
    reach = lay_over(
        T,
        surface,
        model.normals[: config.model_points],
        footprint.middle,
        footprint.T_plane_cam[:3, 3],
        directions,
        config.least_facing,
    )
    more = reach - footprint.extent(directions)
    T = with_ends(T, more, directions, config.hidden)
    return np.asarray(np.linalg.inv(footprint.T_plane_cam) @ T)


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


def _longest(T_plane_model: Array, surface: Array) -> Array:
    """Unit directions (B, 2) along the plane in which a surface (m, 3) reaches furthest, placed in
    each way (B, 4, 4)."""
    about = surface - surface.mean(axis=0)
    along = T_plane_model[:, :2, :3] @ (about.T @ about) @ T_plane_model[:, :2, :3].swapaxes(1, 2)
    return np.asarray(np.linalg.eigh(along)[1][:, :, 1])


@lru_cache(maxsize=4)
def turns(count: int) -> Array:
    """(count, 4, 4), evenly spread about the third axis."""
    angle = np.arange(count) * (2 * np.pi / count)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, 0, 0] = T[:, 1, 1] = np.cos(angle)
    T[:, 1, 0] = np.sin(angle)
    T[:, 0, 1] = -T[:, 1, 0]
    return T
