"""Other masks than those that were made: what may be one object, and what may be two.

Depth alone cannot tell the halves of a clamp from two things that touch. A stored object that fits
one of these masks can.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import count, product

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.mending import RegroupConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.dilate import mask_box
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.seeds import child_rng
from brrp_cli.segmentation.cut import boundary_of, cut_at_strongest, filled

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class OtherMask:
    """mask : (H, W); of : the ids of the masks that it is made of, none for what was background;
    cut : whether of parts of them; known : those of them in which a stored object is recognised"""

    mask: Mask
    of: frozenset[int]
    cut: bool = False
    known: frozenset[int] = frozenset()


def other_masks(
    frame: Frame,
    ids: Sequence[int],
    aside: NDArray[np.integer] | None,
    config: SegmentConfig,
    seed: int = 0,
    whole: Collection[int] = (),
    known: Collection[int] = (),
) -> list[OtherMask]:
    """Masks of what was left out, `aside` (H, W); unions of these and of the masks `ids` with their
    neighbours, all of them and two by two, and with those near them in the same colours; of each of
    `ids` with a neighbour among `known`; and parts of each of `ids` and of what was left out, by
    its inner boundary and by colour. `config.regroup.most` of them at most.

    whole : ids of masks that are not cut; known : in which a stored object is recognised
    """
    own = config.regroup
    both, left_out = frame, list[int]()
    if aside is not None:
        both, left_out = with_left_out(frame, aside)
    groups = [frozenset([i]) for i in left_out] + unions(both, [*ids, *left_out], own)
    found = [
        OtherMask(np.isin(both.segmap, list(group)), group.difference(left_out)) for group in groups
    ]
    found += [
        OtherMask(np.isin(frame.segmap, list(pair)), pair, known=pair.intersection(known))
        for pair in _near(frame, [*ids, *known], own.reach, own.gap)
        if len(pair.intersection(known)) == 1
    ]
    may = [*(i for i in ids if i not in whole), *left_out]
    large = [i for i in may if _size(frame, both.segmap == i) >= own.least_cut]
    if large:
        edges = boundary_of(frame, seed, config)
        for i in large:
            rng = child_rng(seed, "colour groups", i)
            found += [
                OtherMask(part, frozenset([i]).difference(left_out), cut=True)
                for part in parts(both, i, edges, config, rng)
            ]
    return [each for each in found if _size(frame, each.mask) >= own.least_pixels][: own.most]


def unions(frame: Frame, ids: Sequence[int], config: RegroupConfig) -> list[frozenset[int]]:
    """Of the masks `ids`, those that hang together, and of more than two of them each two that are
    neighbours; and those that hang together over wider gaps and have the same colours, as pieces of
    a thin ring do."""
    pairs = _near(frame, ids, config.reach, config.gap)
    found = [*_hanging_together(ids, pairs), *pairs]
    if frame.coloured and config.apart > config.reach:
        near = _near(frame, ids, config.apart, config.gap)
        colours = _colours(frame, frozenset[int]().union(*near))
        alike = [
            pair
            for pair in near
            if np.linalg.norm(np.diff([colours[i] for i in pair], axis=0)) < config.alike
        ]
        found += _hanging_together(ids, alike)
    return list(dict.fromkeys(found))


def _hanging_together(ids: Sequence[int], pairs: Sequence[frozenset[int]]) -> list[frozenset[int]]:
    """Groups of two or more that pairs connect."""
    groups = {i: frozenset([i]) for i in ids}
    for pair in pairs:
        whole = frozenset[int]().union(*(groups[i] for i in pair))
        groups.update(dict.fromkeys(whole, whole))
    return [group for group in dict.fromkeys(groups.values()) if len(group) > 1]


def _colours(frame: Frame, ids: Collection[int]) -> dict[int, NDArray[np.float64]]:
    """The median colour of each of the masks, L*a*b*."""
    rgb2lab = import_library("skimage.color").rgb2lab
    return {i: np.median(rgb2lab(frame.rgb[frame.segmap == i]), axis=0) for i in ids}


def painted(
    segmap: NDArray[np.integer], masks: Sequence[OtherMask], first_free: int
) -> tuple[NDArray[np.int64], dict[int, OtherMask]]:
    """The map (H, W) with those masks, and which is which, by id: a union of whole masks has its
    lowest id, what is new one from `first_free` on."""
    found, named = segmap.astype(np.int64), {}
    free = count(max(int(segmap.max()) + 1, first_free))
    for each in masks:
        object_id = next(free) if each.cut or not each.of else min(each.of)
        found[each.mask] = object_id
        named[object_id] = each
    return found, named


def with_left_out(frame: Frame, aside: NDArray[np.integer]) -> tuple[Frame, list[int]]:
    """The frame with what was left out as masks where it has none, and their ids."""
    last = int(frame.segmap.max())
    here = (aside != BACKGROUND) & (frame.segmap == BACKGROUND)
    both = np.where(here, aside.astype(np.int64) + last, frame.segmap)
    return frame.with_masks(both), [int(i) for i in np.unique(both[here])]


def _near(frame: Frame, ids: Sequence[int], reach: int, gap: float) -> list[frozenset[int]]:
    """Each two of the masks that come within `reach` pixels of each other in the image, and there
    within `gap` metres in depth."""
    ndimage = import_library("scipy.ndimage")
    solid = np.where(np.isin(frame.segmap, list(ids)) & frame.valid, frame.segmap, BACKGROUND)
    depth = frame.points[..., 2]
    pairs = []
    for i in sorted(ids):
        window = mask_box(solid == i, reach)
        others, here = solid[window], solid[window] == i
        if not here.any():
            continue
        far, nearest = ndimage.distance_transform_edt(~here, return_indices=True)
        beside = (others > i) & (far <= reach)
        apart = np.abs(depth[window][tuple(nearest)] - depth[window])
        pairs += [
            frozenset((i, int(j)))
            for j in np.unique(others[beside])
            if np.median(apart[beside & (others == j)]) < gap
        ]
    return pairs


def parts(
    frame: Frame,
    object_id: int,
    boundary: NDArray[np.float64],
    config: SegmentConfig,
    rng: np.random.Generator,
) -> list[Mask]:
    """What may be an object of its own in one mask: halves on both sides of its strongest boundary
    (H, W), and what hangs together in colour. Parts that are nearly alike come once."""
    own = config.regroup
    window = mask_box(frame.segmap == object_id, 1)
    mask, seen = frame.segmap[window] == object_id, frame.valid[window]
    cut = cut_at_strongest(mask & seen, boundary[window], 2, config)
    pieces = [] if cut is None else _pieces(filled(mask, cut), mask)
    lab = _smooth_colours(frame.rgb[window], mask, own)
    for labels in colour_groups(lab, mask, own, rng):
        pieces += [
            each
            for each in _pieces(labels, mask)
            if (rest := mask & ~each).any()
            and np.linalg.norm(lab[each].mean(axis=0) - lab[rest].mean(axis=0)) > own.differs
        ]
    found: list[Mask] = []
    for piece in pieces:
        alike = own.same * piece.sum()
        if (piece & seen).sum() >= own.least_pixels and not any(
            (piece ^ other).sum() < alike for other in [mask, *found]
        ):
            found.append(piece)
    whole = [np.zeros(frame.shape, np.bool_) for _ in found]
    for each, part in zip(whole, found, strict=True):
        each[window] = part
    return whole


def _smooth_colours(
    rgb: NDArray[np.uint8], mask: Mask, config: RegroupConfig
) -> NDArray[np.float64]:
    """L*a*b* (h, w, 3) with L* of less weight, averaged over near pixels of the mask; 0 outside."""
    ndimage = import_library("scipy.ndimage")
    lab = import_library("skimage.color").rgb2lab(rgb) * [config.lightness, 1, 1]
    around = (config.blur, config.blur, 0)
    weight = ndimage.gaussian_filter(mask.astype(np.float64), config.blur)
    smooth = ndimage.gaussian_filter(np.where(mask[..., None], lab, 0.0), around)
    return np.where(mask[..., None], smooth / np.maximum(weight, 1e-6)[..., None], 0.0)


def colour_groups(
    lab: NDArray[np.float64], mask: Mask, config: RegroupConfig, rng: np.random.Generator
) -> list[NDArray[np.int64]]:
    """Labels (h, w) of a mask's pixels by k-means in colour and place, 0 outside it: of each number
    of groups and each weight of places. lab : (h, w, 3)"""
    vq = import_library("scipy.cluster.vq")
    places = np.argwhere(mask)
    drawn = rng.permutation(len(places))[: config.samples]
    groups = []
    for many, place in product(config.colours, config.places):
        features = np.column_stack([lab[mask], place * places])
        seed = int(rng.integers(2**31))
        middles, _ = vq.kmeans2(features[drawn], many, minit="++", seed=seed)
        labels = np.zeros(mask.shape, np.int64)
        labels[mask] = vq.vq(features, middles)[0] + 1
        groups.append(labels)
    return groups


def _pieces(labels: NDArray[np.int64], mask: Mask) -> list[Mask]:
    """What hangs together of each label, without bridges of a pixel or two, and with its holes."""
    ndimage = import_library("scipy.ndimage")
    found = []
    for label in np.unique(labels[labels > 0]):
        each, many = ndimage.label(ndimage.binary_opening(labels == label))
        found += [ndimage.binary_fill_holes(each == i) & mask for i in range(1, many + 1)]
    return found


def _size(frame: Frame, mask: Mask) -> int:
    """Pixels with depth."""
    return int((mask & frame.valid).sum())
