"""Which objects of a frame are those of the frame before, and which of these have not moved.

Where the camera's motion is known (both frames have T_world_cam, or the background has not moved)
an object is where its points fall, moved as the camera was. Objects that were moved are looked for
near by, by their colour and size. Ids are never used again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import SharpenConfig, TrackConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import transform_points
from brrp_cli.segmentation.other_masks import with_left_out


@dataclass(frozen=True)
class Followed:
    """A frame whose ids are those of the tracks.

    next_id : the first id that is free; left_out : ids of what is recognised in a mask that was
    left out when masks were made, as what the image's border cuts is; strangers : the frame with
    those of these masks in which nothing is
    """

    frame: Frame
    next_id: int
    left_out: frozenset[int] = frozenset()
    strangers: Frame | None = None


def first_frame(frame: Frame) -> Followed:
    """The tracks of a stream's first frame: its own ids."""
    return Followed(frame, max([0, *frame.object_ids]) + 1)


def follow(last: Followed, frame: Frame, config: TrackConfig) -> Followed:
    """The frame with the ids of the last one where an object is the same, and new ones else."""
    T_now_last = camera_motion(last.frame, frame, config)
    matches = match(last.frame, frame, T_now_last, config)
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


def unmoved(before: Frame, frame: Frame, config: TrackConfig) -> frozenset[int]:
    """The ids of two frames of one stream whose object has not moved between them; none where the
    camera has, or may have."""
    T_now_last = camera_motion(before, frame, config)
    if T_now_last is None or not _stands(T_now_last, config):
        return frozenset()
    common = set(before.object_ids) & set(frame.object_ids)
    return frozenset(i for i in common if _unmoved(before, frame, i, config))


def at_rest(
    before: Frame,
    frame: Frame,
    T_now_then: NDArray[np.float64],
    object_id: int,
    config: SharpenConfig,
) -> bool:
    """Whether an object of two frames of one stream, whose camera has moved by T_now_then (4, 4),
    is where it was, as far as both show it."""
    T_then_now = np.asarray(np.linalg.inv(T_now_then))
    return all(
        _agrees(one, other, T, object_id, config)
        for one, other, T in ((before, frame, T_now_then), (frame, before, T_then_now))
    )


def _agrees(
    one: Frame, other: Frame, T: NDArray[np.float64], object_id: int, config: SharpenConfig
) -> bool:
    """Whether little of what one frame saw of an object lies in space that the other saw to be
    free, and depth is the same where both saw it."""
    points = transform_points(T, one.object_points(object_id))
    gap = depth_behind(points, other)
    known = np.isfinite(gap)
    if not known.any() or (gap[known] > config.rest_gap).mean() > config.rest:
        return False
    both = known & (np.abs(gap) < config.rest_gap)
    both &= at_pixels(points, other.segmap, other) == object_id
    # Nothing of it was seen twice: from its other side, nothing speaks against it.
    return not both.any() or abs(float(np.median(gap[both]))) <= config.rest_depth


def spread_out(directions: NDArray[np.float64], count: int) -> list[int]:
    """Which of unit directions (n, 3), oldest first, are kept: of the two nearest to each other the
    older one goes until `count` are left."""
    kept = list(range(len(directions)))
    while len(kept) > count:
        near = directions[kept] @ directions[kept].T
        near[np.tril_indices(len(kept))] = -np.inf
        kept.pop(int(np.unravel_index(np.argmax(near), near.shape)[0]))
    return kept


def camera_motion(last: Frame, frame: Frame, config: TrackConfig) -> NDArray[np.float64] | None:
    """T_now_last (4, 4) between the two camera frames; the identity where nobody tells and the
    background has not moved; None where it has."""
    if last.T_world_cam is not None and frame.T_world_cam is not None:
        return np.asarray(np.linalg.inv(frame.T_world_cam) @ last.T_world_cam)
    if last.shape != frame.shape or not np.allclose(last.K, frame.K):
        return None
    ground = (last.segmap == BACKGROUND) & (frame.segmap == BACKGROUND)
    both = ground & last.valid & frame.valid
    if both.sum() < config.ground * both.size:
        return None
    apart = np.abs(last.points[both][:, 2] - frame.points[both][:, 2])
    # A camera that turns changes depth at every edge, one that slides along a table at few places.
    colour = np.abs(last.rgb[ground].astype(np.int16) - frame.rgb[ground]).mean()
    same = (
        np.median(apart) <= config.still
        and np.quantile(apart, 0.9) <= config.still_tail * config.still
    )
    return np.eye(4) if same and colour <= config.still_colour else None


def _stands(T: NDArray[np.float64], config: TrackConfig) -> bool:
    turned = np.linalg.norm(T[:3, :3] - np.eye(3))
    return bool(max(turned, np.linalg.norm(T[:3, 3])) <= config.still_camera)


def match(
    last: Frame, frame: Frame, T_now_last: NDArray[np.float64] | None, config: TrackConfig
) -> dict[int, int]:
    """Id in the frame -> id in the last one: first by place, then, of what is left, by nearness,
    colour and size."""
    T = np.eye(4) if T_now_last is None else T_now_last
    found = _assign(last, frame, lambda a, b: _overlap(last, frame, T, a, b, config), {})
    return found | _assign(last, frame, lambda a, b: _alike(last, frame, T, a, b, config), found)


def _assign(
    last: Frame, frame: Frame, score: Callable[[int, int], float], taken: dict[int, int]
) -> dict[int, int]:
    """Pairs (id, id of the last frame) of the largest sum of scores, of those above 0."""
    from scipy.optimize import linear_sum_assignment

    old = [i for i in last.object_ids if i not in taken.values()]
    new = [i for i in frame.object_ids if i not in taken]
    if not old or not new:
        return {}
    scores = np.array([[score(a, b) for b in new] for a in old])
    rows, columns = linear_sum_assignment(-scores)
    return {new[c]: old[r] for r, c in zip(rows, columns, strict=True) if scores[r, c] > 0}


def _overlap(
    last: Frame, frame: Frame, T: NDArray[np.float64], old: int, new: int, config: TrackConfig
) -> float:
    """Share of the old object's points that fall on the new mask; 0 where it is too little."""
    points = transform_points(T, last.object_points(old))
    if not len(points):
        return 0.0
    ids = at_pixels(points, frame.segmap, frame)
    hits = float((ids == new).sum()) / len(points)
    return hits if hits >= config.overlap else 0.0


def _alike(
    last: Frame, frame: Frame, T: NDArray[np.float64], old: int, new: int, config: TrackConfig
) -> float:
    """1 where the new object stands on the old one's place and looks as it did, down to 0."""
    before, now = last.segmap == old, frame.segmap == new
    points, seen = transform_points(T, last.object_points(old)), frame.object_points(new)
    if not len(points) or not len(seen):
        return 0.0
    way = float(np.linalg.norm(np.median(points, axis=0) - np.median(seen, axis=0)))
    colour = np.abs(last.rgb[before].mean(axis=0) - frame.rgb[now].mean(axis=0)).mean()
    growth = max(before.sum(), now.sum()) / min(before.sum(), now.sum())
    if way > config.reach or colour > config.colour or growth > config.growth:
        return 0.0
    return float((1 - way / config.reach) * (1 - colour / config.colour)) + 1e-9


def _unmoved(last: Frame, frame: Frame, object_id: int, config: TrackConfig) -> bool:
    """Whether an object is where it was, in images of one camera that stands."""
    if last.shape != frame.shape:
        return False
    before, now = last.segmap == object_id, frame.segmap == object_id
    if (before & now).sum() < config.still_mask * (before | now).sum():
        return False
    both = before & now & last.valid & frame.valid
    if not both.any():
        return False
    apart = frame.points[both][:, 2] - last.points[both][:, 2]
    # Noise of single pixels is no motion: the middle of their differences tells of it.
    shifted, scattered = abs(float(np.median(apart))), float(np.median(np.abs(apart)))
    return shifted <= config.still and scattered <= config.noise
