"""Which objects of a frame are those of the frame before.

An object is where its points fall, moved as the camera was. Objects that were moved are looked for
near by, by their colour and size.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import inverse, transform_points


def match(
    last: Frame, frame: Frame, T_now_last: NDArray[np.float64] | None, config: TrackConfig
) -> dict[int, int]:
    """Id in the frame -> id in the last one: first by place, then, of what is left, by nearness,
    colour and size."""
    T = np.eye(4) if T_now_last is None else T_now_last
    found = _assign(last, frame, lambda a, b: _overlap(last, frame, T_now_last, a, b, config), {})
    moved = set(last.object_ids) - set(found.values())
    if T_now_last is not None:
        moved = {i for i in moved if _shows_its_place(last, frame, T, i, config)}

    def alike(old: int, new: int) -> float:
        return _alike(last, frame, T, old, new, config) if old in moved else 0.0

    return found | _assign(last, frame, alike, found)


def _shows_its_place(
    last: Frame, frame: Frame, T: NDArray[np.float64], old: int, config: TrackConfig
) -> bool:
    """Whether the frame shows enough of where the object was to tell that it has moved."""
    gap = depth_behind(transform_points(T, last.object_points(old)), frame)
    return bool(len(gap)) and float((gap >= -config.carry.gap).mean()) >= config.shown


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


def seen_again(
    last: Frame, frame: Frame, T_now_last: NDArray[np.float64], old: int, new: int, near: float
) -> float:
    """Share of the old object's points that fall on the new mask: on its surface, within `near`
    metres, or behind it by no more than the object is thick, for then it is another's."""
    points = last.object_points(old)
    if not len(points):
        return 0.0
    moved = transform_points(T_now_last, points)
    gap = depth_behind(moved, frame)
    # Where there is no depth nobody can tell.
    there = ~(gap > near) & ~(gap < -max(near, thickness(points)))
    return float((there & (at_pixels(moved, frame.segmap, frame) == new)).mean())


def seen_both_ways(
    then: Frame, now: Frame, T_now_then: NDArray[np.float64], object_id: int, near: float
) -> float:
    """Share of an object's points in either frame that the other one shows, the lower of both;
    near : as in `seen_again`."""
    return min(
        seen_again(then, now, T_now_then, object_id, object_id, near),
        seen_again(now, then, inverse(T_now_then), object_id, object_id, near),
    )


def thickness(points: NDArray[np.floating]) -> float:
    """Metres, the second of the three sides of a box around points (n, 3), along their axes."""
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return float(np.sort(np.ptp(centred @ axes, axis=0))[1])


def _overlap(
    last: Frame,
    frame: Frame,
    T_now_last: NDArray[np.float64] | None,
    old: int,
    new: int,
    config: TrackConfig,
) -> float:
    """Share of the old object's points that fall on the new mask; 0 where it is too little."""
    if T_now_last is not None:
        hits = seen_again(last, frame, T_now_last, old, new, config.carry.gap)
    else:
        ids = at_pixels(last.object_points(old), frame.segmap, frame)
        hits = float((ids == new).mean()) if len(ids) else 0.0
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
