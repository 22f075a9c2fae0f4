"""Masks that are taken together or apart because a stored object is recognised in them then."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.dilate import opened
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.mending.again import Again, replaced
from brrp_cli.mending.chosen import chosen
from brrp_cli.mending.tries import Tries
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import ObjectReconstruction, Reconstruction
from brrp_cli.segmentation.other_masks import OtherMask, other_masks, painted


def regroup(
    result: Reconstruction,
    prior: Prior,
    again: Again,
    config: SegmentConfig,
    aside: NDArray[np.integer] | None = None,
    asked: Collection[int] | None = None,
    first_free: int = 1,
) -> Reconstruction:
    """The reconstruction with those other masks of what was not recognised, and of its neighbours,
    in which a stored object is: the ones that it explains most of, first. What is left of a mask
    keeps its id, and may be regrouped in the next round.

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
    may = [each for each in result.objects if asked is None or each.object_id in asked]
    sure = [each.object_id for each in may if _recognised(each, own.least_weight)]
    doubtful = [each.object_id for each in may if each.object_id not in sure]
    whole = [each.object_id for each in result.objects if _is_one(each, own.least_weight)]
    tries = Tries(result, prior, again, config)
    masks = other_masks(frame, doubtful, aside, config, result.seed, whole, sure)
    found = tries.found(masks)
    free = np.isin(frame.segmap, doubtful)
    if aside is not None:
        free |= (aside != BACKGROUND) & (frame.segmap == BACKGROUND)
    known = tries.known(may) if free.any() else []
    found += tries.found(tries.grown([*found, *known], masks, free))
    taken = chosen([each for each in found if tries.fits(each)], tries)
    if not taken:
        return result
    segmap, named = painted(frame.segmap, taken, first_free)
    segmap = _without_scraps(segmap, named, frame, config)
    changed = set(named).union(*(each.of for each in taken))
    return replaced(result, frame.with_masks(segmap), changed, again)


def _recognised(item: ObjectReconstruction, least_weight: float) -> bool:
    found = item.recognised
    return found is not None and (found.weight or 0.0) >= least_weight


def _is_one(item: ObjectReconstruction, least_weight: float) -> bool:
    """Whether a mask is of one thing: one of the stored objects, whichever of them, or one that has
    the shape of a stored object, stretched."""
    stored = item.unknown_weight is not None and 1 - item.unknown_weight >= least_weight
    return stored or item.like is not None


def _without_scraps(
    segmap: NDArray[np.int64], named: dict[int, OtherMask], frame: Frame, config: SegmentConfig
) -> NDArray[np.int64]:
    """What is left of a mask that was cut and is too small for an object: its rims stay with the
    part that was recognised, and the rest is background."""
    segmap = segmap.copy()
    for object_id, mask in named.items():
        for source in mask.of - {object_id}:
            left = segmap == source
            solid = opened(left, config.mend.opening)
            if source != BACKGROUND and (solid & frame.valid).sum() < config.regroup.least_pixels:
                segmap[left] = object_id
                segmap[solid] = BACKGROUND
    return segmap
