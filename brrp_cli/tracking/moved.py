"""What was made of an object, given in the frame of a camera that has moved since."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import transform_points
from brrp_cli.reconstruction import MovablePosterior, ObjectReconstruction, Retrieved
from brrp_cli.tracking.match import seen_both_ways
from brrp_cli.tracking.motion import same_gap, same_side


def holds(
    then: Frame, now: Frame, T_now_then: NDArray[np.float64], object_id: int, config: TrackConfig
) -> bool:
    """Whether an object of two frames, whose camera has moved by T_now_then (4, 4), is where it
    was, and both show about the same of it."""
    points = then.object_points(object_id)
    if config.glide is None or not same_side(points, T_now_then, config.glide):
        return False
    if seen_both_ways(then, now, T_now_then, object_id, config.carry.gap) < config.glide.same:
        return False
    points = transform_points(T_now_then, points)
    gap = depth_behind(points, now)
    seen = (np.abs(gap) <= config.carry.gap) & (at_pixels(points, now.segmap, now) == object_id)
    return same_gap(gap[seen], points[seen, 2], config.glide.depth, config)


def moved_object(
    item: ObjectReconstruction, T_now_then: NDArray[np.float64]
) -> ObjectReconstruction | None:
    """The object in the frame that T_now_then (4, 4), rigid, leads to; None where its posterior
    cannot be given there."""
    posterior, surface = item.posterior, item.surface
    if not isinstance(posterior, MovablePosterior) or surface is None:
        return None
    center, observed, T = item.center, item.observed, T_now_then
    return replace(
        item,
        center=None if center is None else np.asarray(transform_points(T, center), np.float64),
        observed=None if observed is None else transform_points(T, observed).astype(np.float32),
        retrieved=[_moved(each, T) for each in item.retrieved],
        posterior=posterior.moved(T),
        surface=replace(
            surface, vertices=np.asarray(transform_points(T, surface.vertices), np.float64)
        ),
    )


def _moved(found: Retrieved, T_now_then: NDArray[np.float64]) -> Retrieved:
    return replace(
        found,
        T_cam_object=None if found.T_cam_object is None else T_now_then @ found.T_cam_object,
        T_cam_mesh=None if found.T_cam_mesh is None else T_now_then @ found.T_cam_mesh,
        alike=tuple(T_now_then @ each for each in found.alike),
    )
