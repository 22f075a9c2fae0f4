"""Masks in which other objects were looked for before, from about the same side."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.tracking.match import seen_both_ways
from brrp_cli.tracking.motion import camera_motion, side_turn


def tried_before(tried: Mapping[int, Frame], now: Frame, config: TrackConfig) -> set[int]:
    """Ids of objects at rest whose mask is about the one in which others were looked for in an
    earlier frame, which saw it from about the same side.

    tried : id -> that frame
    """
    motions: dict[int, NDArray[np.float64] | None] = {}
    found = set()
    for object_id in tried.keys() & set(now.object_ids):
        then = tried[object_id]
        if id(then) not in motions:
            motions[id(then)] = camera_motion(then, now, config)
        T_now_then = motions[id(then)]
        if T_now_then is not None and _same_view(then, now, T_now_then, object_id, config):
            found.add(object_id)
    return found


def _same_view(
    then: Frame, now: Frame, T_now_then: NDArray[np.float64], object_id: int, config: TrackConfig
) -> bool:
    points = now.object_points(object_id)
    if not len(points) or side_turn(points, T_now_then) > config.carry.side:
        return False
    return seen_both_ways(then, now, T_now_then, object_id, config.carry.gap) >= config.carry.same
