"""How the camera has moved between two frames, which objects have not, and which are at rest.

The camera's motion is known where both frames have a pose or the background has not moved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.tracking import GlideConfig, SharpenConfig, TrackConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import inverse, normalise, transform_points


def unmoved(before: Frame, frame: Frame, config: TrackConfig) -> frozenset[int]:
    """The ids of two frames of one stream whose object has not moved between them; none where the
    camera has, or may have."""
    T_now_last = camera_motion(before, frame, config)
    if T_now_last is None or not camera_stands(T_now_last, config):
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
    T_then_now = inverse(T_now_then)
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
    """T_now_last (4, 4) between the two camera frames, as both tell or as was found; else the
    identity where the background has not moved, and None where it has."""
    if last.T_world_cam is not None and frame.T_world_cam is not None:
        return inverse(frame.T_world_cam) @ last.T_world_cam
    before, now = last.stream_pose, frame.stream_pose
    if before is not None and now is not None and before.stream == now.stream:
        return inverse(now.T_stream_cam) @ before.T_stream_cam
    return np.eye(4) if background_stands(last, frame, config) else None


def background_stands(last: Frame, frame: Frame, config: TrackConfig) -> bool:
    """Whether two frames of one camera show the same background."""
    if last.shape != frame.shape or not np.allclose(last.K, frame.K):
        return False
    ground = (last.segmap == BACKGROUND) & (frame.segmap == BACKGROUND)
    both = ground & last.valid & frame.valid
    if both.sum() < config.ground * both.size:
        return False
    apart = np.abs(last.depth[both] - frame.depth[both]) / noisier(last.depth[both])
    # A camera that turns changes depth at every edge, one that slides along a table at few places.
    colour = np.abs(last.rgb[ground].astype(np.int16) - frame.rgb[ground]).mean()
    return bool(
        np.median(apart) <= config.still
        and np.quantile(apart, config.still_most) <= config.still_tail * config.still
        and colour <= config.still_colour
        and edge_motion(last, frame, config) <= config.still_edges
    )


def edge_motion(last: Frame, frame: Frame, config: TrackConfig) -> float:
    """Pixels by which the edges of two images lie apart, the median of what each of the stronger
    ones tells across itself (normal flow); 0 where there are too few."""
    # Blurred, or a sharp edge would be seen on one side alone; channel by channel, since things of
    # other colours can be as bright.
    blur = import_library("scipy.ndimage").uniform_filter
    before, now = (
        np.stack([blur(each.rgb[..., i].astype(np.float32), 3) for i in range(3)])
        for each in (last, frame)
    )
    slope = np.hypot(
        before[:, 2:, 1:-1] - before[:, :-2, 1:-1], before[:, 1:-1, 2:] - before[:, 1:-1, :-2]
    )
    slope /= 2
    changed = np.abs(now - before)[:, 1:-1, 1:-1]
    strong = slope >= config.edge
    if strong.sum() < config.least_edges:
        return 0.0
    return float(np.median(changed[strong] / slope[strong]))


def side_turn(points: NDArray[np.floating], T_now_then: NDArray[np.float64]) -> float:
    """Radians between the directions in which a camera that has moved by T_now_then (4, 4) saw the
    middle of points (n, 3), camera frame, then and now."""
    middle = np.median(points, axis=0).astype(np.float64)
    now, then = normalise(np.stack([-middle, T_now_then[:3, 3] - middle]))
    return float(np.arccos(np.clip(now @ then, -1, 1)))


def camera_stands(T: NDArray[np.float64], config: TrackConfig) -> bool:
    """Whether a camera that has moved by T (4, 4) stands, as poses go."""
    turned = np.linalg.norm(T[:3, :3] - np.eye(3))
    return bool(max(turned, np.linalg.norm(T[:3, 3])) <= config.still_camera)


def _unmoved(last: Frame, frame: Frame, object_id: int, config: TrackConfig) -> bool:
    """Whether an object is where it was, in images of one camera that stands."""
    if last.shape != frame.shape:
        return False
    before, now = last.segmap == object_id, frame.segmap == object_id
    if (before & now).sum() < config.still_mask * (before | now).sum():
        return False
    return same_depth(last, frame, before & now, config)


def same_depth(last: Frame, frame: Frame, mask: NDArray[np.bool_], config: TrackConfig) -> bool:
    """Whether depth within a mask (H, W) is what it was, in images of one camera that stands."""
    both = mask & last.valid & frame.valid
    return same_gap(frame.depth[both] - last.depth[both], last.depth[both], config.still, config)


def same_gap(
    apart: NDArray[np.floating], depth: NDArray[np.floating], most: float, config: TrackConfig
) -> bool:
    """Whether differences (n,) of depth, metres, at so many points are those of noise.

    most : their median, metres, at most
    """
    if not len(apart):
        return False
    # Noise of single pixels is no motion: the middle of their differences tells of it.
    shifted = abs(float(np.median(apart)))
    scattered = float(np.median(np.abs(apart) / noisier(depth)))
    return shifted <= most and scattered <= config.noise


def same_side(
    points: NDArray[np.floating], T_now_then: NDArray[np.float64], config: GlideConfig
) -> bool:
    """Whether a camera that has moved by T_now_then (4, 4) sees points (n, 3) of its earlier frame
    from about the same side and as near."""
    if not len(points):
        return False
    then = np.median(points, axis=0).astype(np.float64)
    now = transform_points(T_now_then, then)
    factor = float(np.linalg.norm(now) / np.linalg.norm(then))
    return (
        side_turn(now[None], T_now_then) <= config.side and 1 / config.near <= factor <= config.near
    )


def noisier(depth: NDArray[np.floating]) -> NDArray[np.floating]:
    """Factor by which depth (n,), metres, is noisier than at one metre, where that is far."""
    return np.maximum(depth, 1.0) ** 2
