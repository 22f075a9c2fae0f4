"""Object masks without a model: what stands on the table, apart in the image or on the table.

Pixels that rise above the table are split into fragments where the image shows a depth edge;
fragments that stand on the same spot of the table are one object. Objects that touch come out
as one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.fragments import find_fragments, flying_pixels, grow, merge_by_footprint
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.inside import fill_inside
from brrp_cli.frames.table import find_table


@dataclass(frozen=True)
class SegmentConfig:
    """Lengths are metres.

    min_height : what rises less above the table, within a metre of the camera, is the table
        (farther away this grows with the square of the distance, as depth noise does)
    rim_height, reach : pixels higher than that join an object within `reach`
    max_slope : steeper surface (depth over width) is taken for flying pixels
    overlap : fragments whose footprints share that part of the smaller one are one object
    margin : how far beside the seen table an object may stand
    min_area : objects that show less of themselves are dropped, metres squared
    """

    min_height: float = 0.012
    rim_height: float = 0.010
    reach: float = 0.008
    max_slope: float = 4.5
    overlap: float = 0.12
    margin: float = 0.03
    min_area: float = 0.0009


def segment(frame: Frame, seed: int = 0, config: SegmentConfig | None = None) -> NDArray[np.int64]:
    """Masks (H, W) of the objects that stand free on the table: 1, 2, ... from left to right.

    The frame's own masks are not looked at; background, also behind the table, is 0.

    Errors: FrameError if there is no table or nothing stands on it.
    """
    config = config or SegmentConfig()
    valid = frame.valid
    table = find_table(frame.points[valid], seed, frame.source)
    points = np.where(valid[..., None], frame.points, np.nan)
    height = table.plane.signed_distance(points)
    plan = table.plan(points)
    lift = config.min_height * np.maximum(1.0, points[..., 2] ** 2)
    with np.errstate(invalid="ignore"):
        on_table = np.zeros(frame.shape, dtype=bool)
        on_table[valid] = table.holds(plan[valid], config.margin)
        risen = on_table & (height > lift)
        rim = on_table & (height > config.rim_height)
    flying = flying_pixels(points[..., 2], frame.K, config.max_slope)
    fragments = find_fragments(risen & ~flying)
    segmap = merge_by_footprint(fragments, plan, config.overlap)
    segmap = grow(segmap, points, rim, config.reach)
    segmap = fill_inside(segmap, plan, on_table & (height > -lift))
    return _numbered(segmap, frame, config.min_area)


def _numbered(segmap: NDArray[np.int64], frame: Frame, min_area: float) -> NDArray[np.int64]:
    """The masks without small ones, numbered by the column of their middle."""
    # What a pixel covers at its depth, seen face on.
    area = np.nan_to_num(frame.points[..., 2] ** 2) / (frame.K[0, 0] * frame.K[1, 1])
    areas = np.bincount(segmap.ravel(), weights=area.ravel())
    columns = np.broadcast_to(np.arange(frame.shape[1]), frame.shape)
    middles = {
        int(i): float(columns[segmap == i].mean())
        for i in np.flatnonzero(areas >= min_area)
        if i != BACKGROUND
    }
    if not middles:
        raise FrameError(
            "Nothing stands on the table",
            where=frame.source,
            expected="objects that rise above their support plane",
            found=f"none that shows {min_area * 1e4:g} cm^2 of itself",
            fix="move the camera nearer, or pass masks with --masks",
        )
    numbered = np.zeros_like(segmap)
    for number, old in enumerate(sorted(middles, key=lambda i: middles[i]), start=1):
        numbered[segmap == old] = number
    return numbered
