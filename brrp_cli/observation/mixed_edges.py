"""The outline of an object at a jump of depth, where a camera mixes the depths of both sides.

Over how many pixels it does is read off the frame: along outlines with the background far behind,
depth between that of the object and that of the background is flying. Stereo matching and time of
flight mix over one to three pixels, structured light hardly. Where a camera mixes, depth along such
outlines tells little, and contradicts the true shape: it is left out, and the mask says where the
object ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import MixedEdgesConfig
from brrp_cli.frames.dilate import distance_to, mask_box, opened
from brrp_cli.frames.frame import BACKGROUND, Frame

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class _Outline:
    """One object, in a window of the image.

    box : of the window; own : (h, w) its pixels; within, side : (h, w) pixels from each of these to
    the next that is not, and on which of four sides that is; depth, inner : (h, w) metres, as
    measured and of the nearest pixel well within; steep : (h, w) metres, how much deeper than that
    a face hardly is; ids : (h, w) the masks
    """

    box: tuple[slice, slice]
    own: Mask
    within: Array
    side: NDArray[np.int64]
    depth: Array
    inner: Array
    steep: Array
    ids: NDArray[np.integer]


def mixing_width(frame: Frame, config: MixedEdgesConfig) -> int:
    """Pixels from an outline with something far behind it, over which the camera mixes depths."""
    flying, pixels = np.zeros((2, config.most))
    sides: list[float] = []
    for outline in _outlines(frame, frame.object_ids, config):
        between = _between(outline, config)
        told = np.isfinite(between)
        fly = told & (np.nan_to_num(between) > config.flying)
        away = np.rint(outline.within)
        for k in range(config.most):
            pixels[k] += np.count_nonzero(told & (away == k + 1))
            flying[k] += np.count_nonzero(fly & (away == k + 1))
        for side in range(4):
            at = told & (away == 1) & (outline.side == side)
            if np.count_nonzero(at) >= config.least_side:
                sides.append(float(fly[at].mean()))
    # A face that is hardly seen looks alike, on one side of one object.
    if len(sides) < config.least_sides or np.median(sides) < config.share:
        return 0
    return int(np.argmin(np.append(flying >= config.share * np.maximum(pixels, 1), False)))


def without_mixed(frame: Frame, width: int, config: MixedEdgesConfig, ids: Iterable[int]) -> Frame:
    """The frame, where objects of `ids` have no depth within `width` pixels of outlines at which it
    jumps to what is behind, but for parts that are no thicker than that on both sides."""
    if width == 0:
        return frame
    points = frame.points.copy()
    for outline in _outlines(frame, ids, config):
        beside = distance_to(_jumps(outline, config)) <= width
        thick = opened(outline.own, width)
        points[outline.box][outline.own & beside & thick] = np.nan
    return frame.with_points(points)


def _outlines(frame: Frame, ids: Iterable[int], config: MixedEdgesConfig) -> Iterator[_Outline]:
    from scipy.ndimage import distance_transform_edt

    for object_id in ids:
        own = frame.segmap == object_id
        if not own.any():
            continue
        box = mask_box(own, config.reach)
        own, depth = own[box], frame.depth[box].astype(np.float64)
        within, side = _from_outline(own)
        core = own & np.isfinite(depth) & (within > config.most)
        if np.count_nonzero(core) < config.least_pixels:
            continue
        off, nearest = distance_transform_edt(~core, return_indices=True)
        inner = depth[tuple(nearest)]
        steep = config.slope * inner / frame.K[0, 0] * off
        yield _Outline(box, own, within, side, depth, inner, steep, frame.segmap[box])


def _from_outline(own: Mask) -> tuple[Array, NDArray[np.int64]]:
    """Of a mask's pixels (h, w): how far away the nearest one is that is not its, and on which
    side, left, right, above or below."""
    from scipy.ndimage import distance_transform_edt

    padded = np.pad(own, 1)
    off, nearest = distance_transform_edt(padded, return_indices=True)
    down, right = (nearest - np.indices(padded.shape))[:, 1:-1, 1:-1]
    side = np.where(
        np.abs(right) >= np.abs(down), np.where(right < 0, 0, 1), np.where(down < 0, 2, 3)
    )
    return off[1:-1, 1:-1], side


def _between(outline: _Outline, config: MixedEdgesConfig) -> Array:
    """How far (h, w) depth along the outline lies on its way from the object, 0, to the background
    far behind it, 1; NaN elsewhere."""
    from scipy.ndimage import distance_transform_edt

    own, ids = outline.own, outline.ids
    clear = (ids == BACKGROUND) & np.isfinite(outline.depth) & (distance_to(own) > config.most)
    if not clear.any():
        return np.full(own.shape, np.nan)
    off, nearest = distance_transform_edt(~clear, return_indices=True)
    behind = outline.depth[tuple(nearest)]
    _, out = distance_transform_edt(own, return_indices=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        at_jump = own & (off <= config.reach) & (behind - outline.inner > config.far)
        at_jump &= ids[tuple(out)] == BACKGROUND
        deeper = outline.depth - outline.inner
        share = np.where(deeper > outline.steep, deeper / (behind - outline.inner), 0.0)
        return np.where(at_jump & np.isfinite(deeper), share, np.nan)


def _jumps(outline: _Outline, config: MixedEdgesConfig) -> Mask:
    """(h, w) pixels beside the object that lie far behind it, or have no depth."""
    with np.errstate(invalid="ignore"):
        near = outline.depth - outline.inner <= config.jump
    return ~outline.own & ~near
