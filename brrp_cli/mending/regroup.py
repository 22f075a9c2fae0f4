"""Masks that are taken together or apart because a stored object is recognised in them then."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.mending import RegroupConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.mending.again import Again, replaced
from brrp_cli.mending.explain import explained
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.segmentation.other_masks import OtherMask, other_masks, painted


@dataclass(frozen=True)
class _Found:
    """A mask in which a stored object is recognised, of which it explains so many pixels."""

    mask: OtherMask
    pixels: int


def regroup(
    result: Reconstruction,
    prior: Prior,
    again: Again,
    config: SegmentConfig,
    aside: NDArray[np.integer] | None = None,
    asked: Collection[int] | None = None,
    first_free: int = 1,
) -> Reconstruction:
    """The reconstruction with those other masks of what was not recognised in which a stored object
    is: the ones that it explains most of, first. What is left of a mask keeps its id, and may be
    regrouped in the next round.

    aside : (H, W) masks that were left out, 0 = none; asked : ids whose masks may be regrouped,
    None = all; first_free : ids of new objects are this at least
    """
    # A method that weighs no placements recognises nothing.
    if not any(each.unknown_weight is not None for each in result.objects):
        return result
    for _ in range(config.regroup.rounds):
        before = result
        result = _one_round(before, prior, again, config, aside, asked, first_free)
        if result is before:
            break
        old = {each.object_id: each for each in before.objects}
        asked = [i.object_id for i in result.objects if old.get(i.object_id) is not i]
        aside = None
    return result


def _one_round(
    result: Reconstruction,
    prior: Prior,
    again: Again,
    config: SegmentConfig,
    aside: NDArray[np.integer] | None,
    asked: Collection[int] | None,
    first_free: int,
) -> Reconstruction:
    frame, own = result.frame, config.regroup
    doubtful = [
        each.object_id
        for each in result.objects
        if (asked is None or each.object_id in asked) and not _recognised(each, own.least_weight)
    ]
    # What has the shape of a stored object, stretched, is one thing.
    whole = [each.object_id for each in result.objects if each.like is not None]
    masks = other_masks(frame, doubtful, aside, config, result.seed, whole)
    found: list[_Found] = []
    tried: list[ObjectReconstruction] = []
    if masks:
        tried = again.masks(frame, [each.mask for each in masks], own.trial, image=result.image)
    for mask, item in zip(masks, tried, strict=True):
        if not _recognised(item, own.sure):
            continue
        assert item.recognised is not None
        seen = mask.mask & frame.valid
        explains = partial(explained, item.recognised, prior=prior, frame=frame, config=config.mend)
        pixels = explains(seen)
        # The print on a can looks like a smaller can, which would hide more of the can than that.
        everywhere = explains(seen | (frame.valid & (frame.segmap != BACKGROUND)))
        if pixels >= own.explained * seen.sum() and pixels >= own.within * everywhere:
            found.append(_Found(mask, pixels))
    chosen = _chosen(found)
    if not chosen:
        return result
    segmap, named = painted(frame.segmap, chosen, first_free)
    segmap = _without_scraps(segmap, named, frame, own)
    changed = set(named).union(*(each.of for each in chosen))
    return replaced(result, frame.with_masks(segmap), changed, again)


def _recognised(item: ObjectReconstruction, least_weight: float) -> bool:
    found = item.recognised
    return found is not None and (found.weight or 0.0) >= least_weight


def _chosen(found: Sequence[_Found]) -> list[OtherMask]:
    """Those that explain most, without such as overlap a better one."""
    chosen: list[OtherMask] = []
    for each in sorted(found, key=lambda each: -each.pixels):
        if not any((each.mask.mask & other.mask).any() for other in chosen):
            chosen.append(each.mask)
    return chosen


def _without_scraps(
    segmap: NDArray[np.int64], named: dict[int, OtherMask], frame: Frame, config: RegroupConfig
) -> NDArray[np.int64]:
    """What is left of a mask that was cut stays with the part that was recognised, where it would
    be no object."""
    segmap = segmap.copy()
    for object_id, mask in named.items():
        for source in mask.of - {object_id}:
            left = segmap == source
            if source != BACKGROUND and (left & frame.valid).sum() < config.least_pixels:
                segmap[left] = object_id
    return segmap
