"""Masks of the last frame that hold in the next one, as objects are at rest.

Masks that are made of a frame alone know nothing of what was recognised in the last one: they would
be mended anew in every frame, and what came of it would be new objects each time.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import CarryConfig, TrackConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.dilate import opened
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import inverse, transform_points
from brrp_cli.tracking.followed import Followed
from brrp_cli.tracking.motion import camera_motion, camera_stands, same_depth
from brrp_cli.tracking.unchanged import changed_pixels, slides

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class _Before:
    """What the last frame tells of each pixel (H, W) of this one.

    labels : the last frame's masks, where both saw the same surface; seen : where they did
    free : where the last one looked through what is here now
    """

    labels: NDArray[np.int64]
    seen: Mask
    free: Mask


def with_carried(
    last: Followed, frame: Frame, config: TrackConfig, fixed: Collection[int] = ()
) -> tuple[Frame, Mask]:
    """The frame with masks of the last one in place of what covers the same surface; and where
    those that were mended are (H, W).

    Masks hold that were mended and whose object is at rest, and, before a camera that stands, all
    whose object has not moved if the frame has masks there, too: they do not waver with noise.
    fixed : ids of the frame's masks that stay as they are
    """
    segmap = frame.segmap.copy()
    nowhere = np.zeros(frame.shape, np.bool_)
    T_now_last = camera_motion(last.frame, frame, config)
    if T_now_last is None:
        return frame, nowhere
    own = config.carry
    resting = [i for i in sorted(last.mended) if rests(last.frame, frame, T_now_last, i, own)]
    if camera_stands(T_now_last, config) and last.frame.shape == frame.shape:
        others = set(last.frame.object_ids) - last.mended
        changed = changed_pixels(last.frame, frame, config)
        resting += [i for i in sorted(others) if _stays(last.frame, frame, i, changed, config)]
    if not resting:
        return frame, nowhere
    before = _before(last.frame, frame, inverse(T_now_last), own)
    open_ = ~np.isin(segmap, list(fixed))
    carried = np.isin(before.labels, resting) & open_
    shift = int(segmap.max())
    segmap[carried] = before.labels[carried] + shift
    for mask_id in np.unique(frame.segmap[carried & (frame.segmap != BACKGROUND)]):
        mask = frame.segmap == mask_id
        if (mask & carried).sum() >= config.overlap * mask.sum():
            # What slides uncovers a strip, which is no thing that has come.
            near = float(np.median(frame.depth[mask & carried]))
            strip = round(own.gap * float(frame.K[0, 0]) / near)
            come = opened(mask & before.free, own.opening + strip)
            _take_apart(segmap, mask, carried, come, before, own)
    mended = [i + shift for i in last.mended.intersection(resting)]
    return frame.with_masks(segmap), np.isin(segmap, mended)


def rests(
    last: Frame, frame: Frame, T_now_last: NDArray[np.float64], object_id: int, config: CarryConfig
) -> bool:
    """Whether an object is where it was, as far as this frame sees its place."""
    gap = depth_behind(transform_points(T_now_last, last.object_points(object_id)), frame)
    gap = gap[np.isfinite(gap) & (gap > -config.gap)]
    return len(gap) > 0 and float((gap > config.gap).mean()) <= config.moved


def _stays(last: Frame, frame: Frame, object_id: int, changed: Mask, config: TrackConfig) -> bool:
    """Whether an object has not moved before a camera that stands, and has a mask, whichever;
    changed : pixels (H, W) that have, between the two frames."""
    mask = last.segmap == object_id
    if (mask & (frame.segmap != BACKGROUND)).sum() < config.overlap * mask.sum():
        return False
    return same_depth(last, frame, mask, config) and not slides(mask, changed, config)


def _before(
    last: Frame, frame: Frame, T_last_now: NDArray[np.float64], config: CarryConfig
) -> _Before:
    points = transform_points(T_last_now, frame.points[frame.valid].astype(np.float64))
    gap, there = depth_behind(points, last), at_pixels(points, last.segmap, last)
    same = np.abs(gap) <= config.gap
    labels = np.full(frame.shape, BACKGROUND, np.int64)
    seen, free = np.zeros(frame.shape, np.bool_), np.zeros(frame.shape, np.bool_)
    labels[frame.valid] = np.where(same, there, BACKGROUND)
    seen[frame.valid], free[frame.valid] = same, gap > config.gap
    return _Before(labels, seen, free)


def _take_apart(
    segmap: NDArray[np.int64],
    mask: Mask,
    carried: Mask,
    may_have_come: Mask,
    before: _Before,
    config: CarryConfig,
) -> None:
    """What is left of a mask that carried ones cover: what was background is again, what has come
    is an object of its own, and the rest is divided by what is nearest."""
    groups, count = import_library("scipy.ndimage").label(may_have_come)
    come = np.zeros_like(mask)
    for group in range(1, count + 1):
        if (groups == group).sum() >= config.least_pixels:
            come |= groups == group
            segmap[groups == group] = segmap.max() + 1
    bare = mask & before.seen & ~carried & (before.labels == BACKGROUND)
    if come.any():
        # The foot of what has come is as deep as the table was.
        foot = bare & _nearest(come, come | carried)
        segmap[foot] = _nearest(segmap, come)[foot]
        come |= foot
    segmap[bare & ~come] = BACKGROUND
    left = mask & before.seen & ~carried & (before.labels != BACKGROUND)
    told = mask & before.seen
    # What others have of it and would be no object is a border that wavers.
    if opened(left, config.opening).sum() < config.least_pixels:
        told &= ~left
    unknown = mask & ~told & ~come
    segmap[unknown] = _nearest(segmap, told)[unknown]


def _nearest(image: NDArray[np.generic], where: Mask) -> NDArray[np.generic]:
    """The value (H, W) of an image at the nearest pixel of those."""
    near = import_library("scipy.ndimage").distance_transform_edt(
        ~where, return_distances=False, return_indices=True
    )
    return image[tuple(near)]
