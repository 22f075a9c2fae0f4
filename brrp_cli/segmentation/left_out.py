"""Masks that are no whole object on the support surface: cut by the image's border, in the air, or
depth that smears over the table's edge.

What reaches into the image from outside is a part of something (an arm, a hand, a chair, the next
object), and so is what rises above the table and stands on nothing: it belongs to what is beside
or behind the table.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import LeftOutConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.dilate import widened

CUT = "cut by the image's border"
IN_THE_AIR = "off the support surface"
EDGE = "smeared over the table's edge"


def left_out(
    segmap: NDArray[np.int64],
    depth: NDArray[np.floating],
    height: NDArray[np.floating],
    over: NDArray[np.bool_],
    bare: NDArray[np.bool_],
    config: LeftOutConfig,
) -> dict[int, str]:
    """Why a mask is no whole object on the table, `CUT`, `IN_THE_AIR` or `EDGE`, by id.

    segmap : (H, W), 0 = background; depth, height : (H, W) metres along z and above the support
    plane, NaN = no return; over : (H, W) pixels that lie over the table, no farther than it
    reaches; bare : (H, W) pixels of a table that has no depth there, which tells nothing of masks
    """
    ndimage = import_library("scipy.ndimage")
    reasons = {}
    for object_id, box in enumerate(ndimage.find_objects(segmap), start=1):
        if box is None:
            continue
        if border_share(segmap == object_id) > config.cut:
            reasons[object_id] = CUT
            continue
        window = widened(box, config.reach)
        mask = segmap[window] == object_id
        if not (mask & np.isfinite(height[window])).any():
            continue
        if _at_the_edge(mask, depth[window], height[window], bare[window], config):
            reasons[object_id] = EDGE
            continue
        # Balls lie on the table, and beside it are other things.
        is_over = over[window][mask].mean() > config.over
        round_stands = config.over_stands if is_over else config.round_stands
        around = (segmap[window], depth[window], height[window], bare[window])
        if not stands(mask, *around, round_stands, config):
            reasons[object_id] = IN_THE_AIR
    return reasons


def border_share(mask: NDArray[np.bool_]) -> float:
    """The part of a mask's outline that lies on the image's border; 0 of an empty one."""
    ndimage = import_library("scipy.ndimage")
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return 0.0
    # All but the box around it is no part of it, as is what lies beyond the image.
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    inner = np.zeros(mask.shape, dtype=bool)
    inner[1:-1, 1:-1] = True
    outline = mask[box] & ~ndimage.binary_erosion(mask[box])
    return float((outline & ~inner[box]).sum() / max(int(outline.sum()), 1))


def told(reasons: Mapping[int, str]) -> str:
    """How many masks were left out and why, in words."""
    kinds = [(reason, list(reasons.values()).count(reason)) for reason in (CUT, IN_THE_AIR, EDGE)]
    return ", ".join(f"{count} {reason}" for reason, count in kinds if count)


def _at_the_edge(
    mask: NDArray[np.bool_],
    depth: NDArray[np.floating],
    height: NDArray[np.floating],
    bare: NDArray[np.bool_],
    config: LeftOutConfig,
) -> bool:
    """Whether what is low has, around much of it, no table but what is far behind it."""
    ndimage = import_library("scipy.ndimage")
    if np.nanpercentile(height[mask], 100 - config.lowest) >= config.edge_height:
        return False
    around = ndimage.binary_dilation(mask, iterations=config.reach) & ~mask & ~bare
    farther = ~(depth[around] <= np.nanmedian(depth[mask]) + config.edge)
    return bool(farther.sum() > config.edge_share * max(int(around.sum()), 1))


def stands(
    mask: NDArray[np.bool_],
    segmap: NDArray[np.integer],
    depth: NDArray[np.floating],
    height: NDArray[np.floating],
    bare: NDArray[np.bool_],
    round_stands: float,
    config: LeftOutConfig,
) -> bool:
    """Whether a mask reaches down to the table, or something hides its foot or bears it.

    round_stands : metres up to which the lower end of what is round may be hidden
    """
    ndimage = import_library("scipy.ndimage")
    known = mask & np.isfinite(height)
    low, high = np.percentile(height[known], (config.lowest, 100 - config.lowest))
    # Of what is round, seen from above, the lower half is hidden.
    if low < np.clip(config.round * high, config.stands, round_stands):
        return True
    # At the lower end of the outline: what is next to it, in the image?
    outline = known & ~ndimage.binary_erosion(mask)
    if not outline.any():
        return True
    foot = outline & (height <= np.percentile(height[outline], config.foot))
    own = float(np.median(depth[foot]))
    beside = ndimage.binary_dilation(foot, iterations=config.reach) & ~mask
    beside &= np.isfinite(depth) | (segmap != 0) | bare
    nearer = depth[beside] < own - config.touch
    # Also where the other mask has no depth, as at its edge.
    bears = (segmap[beside] != 0) & ~(depth[beside] > own + config.touch)
    return bool((nearer | bears | bare[beside]).sum() > config.held * max(int(beside.sum()), 1))
