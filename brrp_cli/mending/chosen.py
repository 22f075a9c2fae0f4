"""Which of the masks that were tried are taken."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from brrp_cli.mending.tries import Found, Tries
from brrp_cli.segmentation.other_masks import OtherMask


def chosen(found: Sequence[Found], tries: Tries) -> list[OtherMask]:
    """The masks in which an object is beyond doubt, and pairs of parts that make up a mask with an
    object in each: those of which most is explained, without such as overlap a better one."""
    groups = [[each] for each in found if tries.sure(each)]
    groups += [[one, other] for one, other in combinations(found, 2) if _make_up(one, other, tries)]
    taken: list[OtherMask] = []
    for group in sorted(groups, key=lambda group: -sum(each.pixels for each in group)):
        masks = [each.mask for each in group]
        if not any((mask.mask & other.mask).any() for mask in masks for other in taken):
            taken += masks
    return taken


def _make_up(one: Found, other: Found, tries: Tries) -> bool:
    """Whether two parts are all but the whole of one mask: what fills it is less in doubt than what
    leaves a rest that is nothing."""
    frame, own = tries.result.frame, tries.config.regroup
    parts = (one.mask, other.mask)
    if not (parts[0].cut and parts[1].cut) or parts[0].of != parts[1].of or len(parts[0].of) != 1:
        return False
    if min(one.weight, other.weight) < own.half or (parts[0].mask & parts[1].mask).any():
        return False
    source = frame.valid & np.isin(frame.segmap, list(parts[0].of))
    return bool(((parts[0].mask | parts[1].mask) & source).sum() >= own.both * source.sum())
