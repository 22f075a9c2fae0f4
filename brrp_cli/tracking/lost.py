"""Tracks whose object is out of sight: hidden, or beyond the image. Who comes back has its id."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind
from brrp_cli.geometry import transform_points
from brrp_cli.tracking.match import seen_again
from brrp_cli.tracking.motion import camera_motion


@dataclass(frozen=True)
class Lost:
    """The last frame that showed an object, and its id there."""

    frame: Frame
    object_id: int


def lost_tracks(
    last: Frame, lost: Sequence[Lost], now: Frame, config: TrackConfig
) -> tuple[Lost, ...]:
    """Of those that were lost, and of the last frame's objects, which of the new frame shows
    neither the object nor that it is gone, the newest first; `config.lost` at most."""
    here = set(now.object_ids)
    every = [*(Lost(last, i) for i in last.object_ids), *lost]
    out = [each for each in every if each.object_id not in here and not _gone(each, now, config)]
    return tuple(out[: config.lost])


def found_again(
    lost: Sequence[Lost], frame: Frame, new: Sequence[int], config: TrackConfig
) -> dict[int, int]:
    """Id in the frame, of those of `new` -> id of the lost object that stands there again."""
    if not lost or not new:
        return {}
    scores = np.array([[_same(each, frame, i, config) for i in new] for each in lost])
    rows, columns = linear_sum_assignment(-scores)
    return {
        new[c]: lost[r].object_id for r, c in zip(rows, columns, strict=True) if scores[r, c] > 0
    }


def _gone(each: Lost, now: Frame, config: TrackConfig) -> bool:
    """Whether the frame sees through a good part of the place of the object."""
    T_now_then = camera_motion(each.frame, now, config)
    if T_now_then is None:
        return False
    points = transform_points(T_now_then, each.frame.object_points(each.object_id))
    gap = depth_behind(points, now)
    known = np.isfinite(gap)
    return bool(known.any() and (gap[known] > config.carry.gap).mean() > config.overlap)


def _same(each: Lost, frame: Frame, new: int, config: TrackConfig) -> float:
    """Share of the lost object's points that fall on the new mask; 0 where it is too little, or the
    colour is another."""
    T_now_then = camera_motion(each.frame, frame, config)
    if T_now_then is None:
        return 0.0
    hits = seen_again(each.frame, frame, T_now_then, each.object_id, new, config.carry.gap)
    before = each.frame.rgb[each.frame.segmap == each.object_id].mean(axis=0)
    colour = np.abs(before - frame.rgb[frame.segmap == new].mean(axis=0)).mean()
    return hits if hits >= config.overlap and colour <= config.colour else 0.0
