"""Pixels of a mask whose depth is not that of its object: what lies far behind it, or before it,
ramps that lead there, and other objects beside it."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Collection, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from brrp_cli.config.observation import StrayConfig
from brrp_cli.frames.dilate import mask_box
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.observation.bled_edges import bled_pixels
from brrp_cli.observation.lent_pixels import lent_pixels
from brrp_cli.spoken import counted

log = logging.getLogger(__name__)


# Frames that have none, by identity and numbers, while they live: threads try several at a time.
# What is left of a frame has no strays either.
_clean: weakref.WeakValueDictionary[tuple[int, StrayConfig], Frame] = weakref.WeakValueDictionary()


def without_strays(
    frame: Frame,
    config: StrayConfig,
    told: Collection[int] | None = None,
    looked_at: Collection[int] | None = None,
) -> Frame:
    """The frame, with no depth at pixels that their mask holds by mistake; the frame itself where
    there are none.

    told : ids of the objects of which the log tells; looked_at : of those that may have strays;
    None = all

    Masks that are a pixel too wide hold what stands behind the object, and cameras mix the depths
    of both. One such pixel moves the middle of the object's bounding box by half its distance.
    """
    if _clean.get((id(frame), config)) is frame:
        return frame
    stray = np.zeros(frame.shape, dtype=bool)
    for object_id in frame.object_ids if looked_at is None else looked_at:
        own = frame.valid & (frame.segmap == object_id)
        if own.any():
            box = mask_box(own, config.lent.reach)
            for found, why in _left_out(frame, object_id, box, config):
                stray[box] |= found
                if found.any() and (told is None or object_id in told):
                    # A few pixels at the edge are as good as always lost.
                    many = found.sum() >= config.told * own.sum()
                    count = counted(int(found.sum()), "pixel")
                    text = "Object %d: %s of its mask left out, %s"
                    log.log(logging.INFO if many else logging.DEBUG, text, object_id, count, why)
    if stray.any():
        points = frame.points.copy()
        points[stray] = np.nan
        frame = frame.with_points(points)
    _clean[id(frame), config] = frame
    return frame


def _left_out(
    frame: Frame, object_id: int, box: tuple[slice, slice], config: StrayConfig
) -> Iterator[tuple[NDArray[np.bool_], str]]:
    """Pixels of an object's mask in a part of the image that are not the object's, and why."""
    ids = frame.segmap[box]
    mask, others = ids == object_id, (ids != object_id) & (ids != BACKGROUND)
    depth = np.where(frame.valid[box], frame.points[box][..., 2], np.nan)
    bled = bled_pixels(np.where(mask, depth, np.nan), float(frame.K[1, 1]), config.bled)
    yield bled, "between it and what is behind it"
    depth = np.where(bled, np.nan, depth)
    far = stray_pixels(np.where(mask, depth, np.nan), config)
    yield far, "far from it in depth"
    depth = np.where(far, np.nan, depth)
    yield lent_pixels(depth, mask, others, config.lent), "as deep as another object beside it"


def stray_pixels(depth: NDArray[np.floating], config: StrayConfig) -> NDArray[np.bool_]:
    """(H, W) bool: pixels whose depth is not that of the object.

    Neighbours whose depths differ by less than `config.link` hang together. The largest piece is
    the object's; so are pieces of a good size within `config.reach` of its range of depths, which
    grows by them, and scraps within `config.link` of that range.

    depth : (H, W) metres, NaN outside the object's mask and where there is no return
    """
    own = np.isfinite(depth)
    piece, count = _pieces(depth, own, config.link)
    values = depth[own].astype(np.float64)
    size = np.bincount(piece, minlength=count)
    nearest, farthest = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(nearest, piece, values)
    np.maximum.at(farthest, piece, values)
    body = int(size.argmax())
    large = size >= config.share * size[body]
    low, high = nearest[body], farthest[body]
    while True:
        kept = large & (farthest >= low - config.reach) & (nearest <= high + config.reach)
        wider = nearest[kept].min(), farthest[kept].max()
        if wider == (low, high):
            break
        low, high = wider
    kept |= (farthest >= low - config.link) & (nearest <= high + config.link)
    stray = np.zeros(depth.shape, dtype=bool)
    stray[own] = ~kept[piece]
    return stray


def _pieces(
    depth: NDArray[np.floating], own: NDArray[np.bool_], link: float
) -> tuple[NDArray[np.int64], int]:
    """The piece (n,) of each own pixel, row by row, and how many there are."""
    number = np.full(depth.shape, -1)
    number[own] = np.arange(own.sum())
    ends = []
    for a, b in (
        (np.s_[:, 1:], np.s_[:, :-1]),
        (np.s_[1:], np.s_[:-1]),
        (np.s_[1:, 1:], np.s_[:-1, :-1]),
        (np.s_[1:, :-1], np.s_[:-1, 1:]),
    ):
        with np.errstate(invalid="ignore"):
            linked = np.abs(depth[a] - depth[b]) < link
        ends.append((number[a][linked], number[b][linked]))
    first, second = (np.concatenate(each) for each in zip(*ends, strict=True))
    nodes = int(own.sum())
    graph = coo_array((np.ones(len(first), dtype=bool), (first, second)), shape=(nodes, nodes))
    count, piece = connected_components(graph, directed=False)
    return np.asarray(piece, dtype=np.int64), int(count)
