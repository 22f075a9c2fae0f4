"""Things whose feet are hidden stand all the same.

Of what is hidden the network knows less the further it lies from what is seen: of a pot behind
other things it is sure of the upper half alone, which then ends in the air. But what fills a place
at some height reaches down to that height. So given that it does, the place is filled with the
probability P(filled) / P(reaches down), and what stands on the plane reaches down to all of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion
from scipy.special import expit, logit

from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.config import StandingConfig
from brrp_cli.frames.frame import BACKGROUND

Floats = NDArray[np.float32]


def standing(
    logits: Floats, heights: NDArray[np.floating], level: float, config: StandingConfig
) -> Floats:
    """Logits (n,) at nodes with these heights (n,) over the plane, metres, given that the object
    stands on the plane; as they are where the network takes it for one that does not.

    level : metres, of heights that count as one. An object reaches down to a level as probably as
    the most probable place there, or further down, is filled.
    """
    index = np.floor(heights / level).astype(np.int64)
    above = np.flatnonzero(index >= 1)
    if not len(above):
        return logits
    index, filled = index[above], expit(logits[above].astype(np.float64))
    most = np.zeros(int(index.max()) + 1)
    np.maximum.at(most, index, filled)
    reaches = np.maximum.accumulate(most)
    if reaches[1] < config.least:
        return logits
    raised = np.minimum(filled * config.sure / reaches[index], config.sure)
    found = logits.copy()
    more = raised > filled
    found[above[more]] = logit(raised[more])
    return found


def on_others(part: VisiblePart, config: StandingConfig) -> bool:
    """Whether it may stand on other objects: whether these touch the lowest of what is seen."""
    frame, plane = part.frame, part.plane
    if plane is None:
        return False
    own = frame.segmap == part.object_id
    rows, columns = np.nonzero(own)
    window = tuple(slice(max(0, int(e.min()) - 1), int(e.max()) + 2) for e in (rows, columns))
    own, points, ids = own[window], frame.points[window], frame.segmap[window]
    height = plane.signed_distance(points.reshape(-1, 3)).reshape(own.shape)
    border = own & ~binary_erosion(own, np.ones((3, 3), bool)) & np.isfinite(height)
    if not border.any():
        return False
    low = border & (height < height[border].min() + config.foot)
    touches = np.zeros_like(own)
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        beside = np.roll(ids, step, axis)
        gap = np.linalg.norm(np.roll(points, step, axis) - points, axis=-1)
        touches |= (beside != part.object_id) & (beside != BACKGROUND) & (gap < config.gap)
    return bool((low & touches).sum() >= config.touched * low.sum())
