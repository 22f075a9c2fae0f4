"""A stream's frames under the ids of their tracks. Ids are never used again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.segmentation.other_masks import with_left_out
from brrp_cli.tracking.lost import Lost, found_again
from brrp_cli.tracking.match import match
from brrp_cli.tracking.motion import camera_motion, unmoved


@dataclass(frozen=True)
class Followed:
    """A frame whose ids are those of the tracks.

    next_id : the first id that is free; mended : ids of masks that recognised objects changed
    lost : tracks whose object is out of sight
    left_out : ids of what is recognised in a mask that was left out when masks were made, as what
    the image's border cuts is; strangers : the frame with those of these masks in which nothing is
    """

    frame: Frame
    next_id: int
    mended: frozenset[int] = frozenset()
    lost: tuple[Lost, ...] = ()
    left_out: frozenset[int] = frozenset()
    strangers: Frame | None = None


def first_frame(frame: Frame) -> Followed:
    """The tracks of a stream's first frame: its own ids."""
    return Followed(frame, max([0, *frame.object_ids]) + 1)


def follow(last: Followed, frame: Frame, config: TrackConfig) -> Followed:
    """The frame with the ids of the last one, or of what was lost before, where an object is the
    same, and new ones else."""
    T_now_last = camera_motion(last.frame, frame, config)
    matches = match(last.frame, frame, T_now_last, config)
    new = [i for i in frame.object_ids if i not in matches]
    matches |= found_again(last.lost, frame, new, config)
    segmap, next_id = np.zeros_like(frame.segmap), last.next_id
    for object_id in frame.object_ids:
        track = matches.get(object_id)
        if track is None:
            track, next_id = next_id, next_id + 1
        segmap[frame.segmap == object_id] = track
    return Followed(frame.with_masks(segmap), next_id)


def with_known(
    last: Followed, frame: Frame, aside: NDArray[np.integer], config: TrackConfig
) -> Frame:
    """The frame with those masks that were left out of it, `aside` (H, W), 0 = none, in which an
    object lies that was recognised in such a mask of the last one."""
    if not last.left_out:
        return frame
    old = np.where(np.isin(last.frame.segmap, list(last.left_out)), last.frame.segmap, BACKGROUND)
    both, ids = with_left_out(frame, aside)
    new = frame.with_masks(np.where(np.isin(both.segmap, ids), both.segmap, BACKGROUND))
    T_now_last = camera_motion(last.frame, frame, config)
    known = match(last.frame.with_masks(old), new, T_now_last, config)
    here = np.isin(both.segmap, list(known))
    return frame.with_masks(np.where(here, both.segmap, frame.segmap))


def not_tried(
    last: Followed, frame: Frame, aside: NDArray[np.int64], config: TrackConfig
) -> NDArray[np.int64]:
    """Those of the masks that were left out of a frame, `aside` (H, W), 0 = none, that did not rest
    since nothing was recognised in them."""
    before = last.strangers
    if before is None:
        return aside
    now = follow(Followed(before, max(before.object_ids) + 1), frame.with_masks(aside), config)
    resting = unmoved(before, now.frame, config)
    return np.where(np.isin(now.frame.segmap, list(resting)), BACKGROUND, aside)
