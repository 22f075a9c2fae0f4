"""Other masks than those that were made: what may be one object, and what may be two.

Depth alone cannot tell the halves of a clamp from two things that touch. A stored object that fits
one of these masks can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import RegroupConfig, SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.segmentation.cut import boundary_of, cut_at_strongest, filled

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class OtherMask:
    """mask : (H, W); of : the ids of the masks that it is made of, none for what was background"""

    mask: Mask
    of: frozenset[int]


def other_masks(
    frame: Frame, ids: Sequence[int], aside: NDArray[np.integer] | None, config: SegmentConfig
) -> list[OtherMask]:
    """Masks of what was left out, `aside` (H, W); unions of the masks `ids` with their neighbours,
    all of them and two by two; and halves of each. `config.regroup.most` of them at most."""
    own = config.regroup
    found = [] if aside is None else _left_out(frame, aside)
    found += [OtherMask(np.isin(frame.segmap, list(of)), of) for of in unions(frame, ids, own)]
    if any(_size(frame, frame.segmap == i) >= own.least_cut for i in ids):
        boundary = boundary_of(frame, config)
        for i in ids:
            found += _halves(frame, i, boundary, config)
    return [each for each in found if _size(frame, each.mask) >= own.least_pixels][: own.most]


def unions(frame: Frame, ids: Sequence[int], config: RegroupConfig) -> list[frozenset[int]]:
    """Of the masks `ids`, those that hang together, and of more than two of them each two that are
    neighbours."""
    pairs = _neighbours(frame, ids, config)
    groups = {i: frozenset([i]) for i in ids}
    for pair in pairs:
        whole = frozenset[int]().union(*(groups[i] for i in pair))
        groups.update(dict.fromkeys(whole, whole))
    every = [group for group in dict.fromkeys(groups.values()) if len(group) > 1]
    return every + [pair for pair in pairs if pair not in every]


def in_turns(masks: Sequence[OtherMask]) -> list[list[OtherMask]]:
    """The masks in lists of such as do not overlap: each list is one map of masks."""
    turns: list[tuple[Mask, list[OtherMask]]] = []
    for each in masks:
        for taken, turn in turns:
            if not (taken & each.mask).any():
                taken |= each.mask
                turn.append(each)
                break
        else:
            turns.append((each.mask.copy(), [each]))
    return [turn for _, turn in turns]


def painted(
    segmap: NDArray[np.integer], masks: Sequence[OtherMask], first_free: int
) -> tuple[NDArray[np.int64], dict[int, OtherMask]]:
    """The map (H, W) with those masks, and which is which, by id: a union has its lowest id, what
    is new one from `first_free` on."""
    found, named = segmap.astype(np.int64), {}
    free = count(max(int(segmap.max()) + 1, first_free))
    for each in masks:
        object_id = min(each.of) if len(each.of) > 1 else next(free)
        found[each.mask] = object_id
        named[object_id] = each
    return found, named


def _left_out(frame: Frame, aside: NDArray[np.integer]) -> list[OtherMask]:
    free = frame.segmap == BACKGROUND
    return [
        OtherMask((aside == i) & free, frozenset()) for i in np.unique(aside[aside != BACKGROUND])
    ]


def _neighbours(frame: Frame, ids: Sequence[int], config: RegroupConfig) -> list[frozenset[int]]:
    """Each two of the masks that come near each other in the image, and there in depth."""
    ndimage = import_library("scipy.ndimage")
    solid = np.where(np.isin(frame.segmap, list(ids)) & frame.valid, frame.segmap, BACKGROUND)
    depth = frame.points[..., 2]
    pairs = []
    for i, rows, columns in _boxes(solid, ids, config.reach):
        window = (rows, columns)
        others, here = solid[window], solid[window] == i
        far, nearest = ndimage.distance_transform_edt(~here, return_indices=True)
        beside = (others > i) & (far <= config.reach)
        apart = np.abs(depth[window][tuple(nearest)] - depth[window])
        pairs += [
            frozenset((i, int(j)))
            for j in np.unique(others[beside])
            if np.median(apart[beside & (others == j)]) < config.gap
        ]
    return pairs


def _boxes(
    segmap: NDArray[np.integer], ids: Sequence[int], margin: int
) -> list[tuple[int, slice, slice]]:
    """The window around each mask that has a pixel, and `margin` pixels more."""
    found = []
    for i in sorted(ids):
        rows, columns = np.nonzero(segmap == i)
        if len(rows):
            low = [max(int(at.min()) - margin, 0) for at in (rows, columns)]
            high = [int(at.max()) + margin + 1 for at in (rows, columns)]
            found.append((i, slice(low[0], high[0]), slice(low[1], high[1])))
    return found


def _halves(
    frame: Frame, object_id: int, boundary: NDArray[np.float64], config: SegmentConfig
) -> list[OtherMask]:
    mask = frame.segmap == object_id
    if _size(frame, mask) < config.regroup.least_cut:
        return []
    parts = cut_at_strongest(mask & frame.valid, boundary, 2, config)
    if parts is None:
        return []
    whole = filled(mask, parts)
    return [
        OtherMask(whole == label, frozenset([object_id])) for label in np.unique(whole[whole > 0])
    ]


def _size(frame: Frame, mask: Mask) -> int:
    """Pixels with depth."""
    return int((mask & frame.valid).sum())
