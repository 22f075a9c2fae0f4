"""The walls of bins as solids: also where nothing shows them, a hand does not go through them."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.config.table import BinsConfig
from brrp_cli.config.tables import changed
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject
from brrp_cli.segmentation.bins import Bin
from brrp_cli.segmentation.hulls import in_hull
from brrp_cli.segmentation.outlines import corners_of, normals_of, plain, shifted
from brrp_cli.segmentation.seen_surfaces import smoothed
from brrp_cli.segmentation.seen_table import see_table
from brrp_cli.segmentation.table_plane import Table

log = logging.getLogger(__name__)

Array = NDArray[np.float64]
# Corners (8, 3) of a convex solid, metres, camera frame.
Wall = Array


def bin_walls(frame: Frame, seed: int, config: SegmentConfig) -> list[list[Wall]]:
    """The walls of each bin on the table, from the table up to its rim.

    A bin that has a mask is an object, and none of these. A side of which no rim is seen, as where
    the image's border cuts a bin, has no wall.
    """
    points = backproject(smoothed(frame, config), frame.K)
    try:
        table = see_table(points, seed, frame.source, config).table
    except FrameError as error:
        log.info("No table was found, and so no bin: %s", error.what)
        return []
    valid = np.isfinite(points[..., 2])
    points, masked = points[valid], frame.segmap[valid] != BACKGROUND
    plan, height = table.plan(points), table.plane.signed_distance(points)
    found = []
    for each in table.bins:
        there = in_hull(each.outside, plan, 0.0) & (height > config.bins.low)
        walls = there.copy()
        walls[there] = Table(table.plane, table.axes, table.hull, (each,)).walls(
            plan[there], height[there] - each.floor, config.bins
        )
        if not walls.any() or masked[walls].mean() < config.bins.masked:
            found.append(walls_of(each, table, plan[there], height[there], config.bins))
    return found


def segmentation_of(table: dict[str, Any] | None) -> SegmentConfig:
    """How masks were made, as results tell it; the defaults where they came with the frame."""
    return changed(SegmentConfig(), table or {}, "the results", "segmentation.")


def walls_of(each: Bin, table: Table, plan: Array, height: Array, config: BinsConfig) -> list[Wall]:
    """One wall, `config.board` thick, for each side of a bin's outline; all lean alike.

    plan : (n, 2) of points; height : (n,) of them above the table's plane
    """
    half = config.board / 2
    # Cells that hold the rim's edge reach beyond it, by half of one on average.
    rim = each.outside + np.array([0.0, 0.0, each.around + config.cell / 2])
    outline = plain(corners_of(rim), config.corners, config.cell)
    foot = _lean(outline, each, config) * each.rim
    faces = ((half, each.rim), (-half, each.rim), (half - foot, 0.0), (-half - foot, 0.0))
    rings = [
        shifted(outline, out) @ table.axes + (level - table.plane.offset) * table.plane.normal
        for out, level in faces
    ]
    rises = plan[height > each.rim - config.band]
    return [
        np.concatenate([ring[[side, (side + 1) % len(outline)]] for ring in rings])
        for side in range(len(outline))
        if _is_seen(outline[side], outline[(side + 1) % len(outline)], rises, config)
    ]


def _lean(outline: Array, each: Bin, config: BinsConfig) -> float:
    """Tangent by which walls lean outwards: how far the floor falls short of the rim."""
    floor = corners_of(each.inside)
    normals = normals_of(outline)
    short = (normals * outline).sum(axis=1) - (floor @ normals.T).max(axis=0)
    # As cells do that hold a part of the wall.
    lean = (np.median(short) - config.cell) / max(each.rim - each.floor, config.cell)
    return float(np.clip(lean, 0.0, config.lean))


def _is_seen(first: Array, last: Array, rises: Array, config: BinsConfig) -> bool:
    """Whether points (n, 2) that rise to the rim or beyond it lie along a side, cell by cell."""
    along = last - first
    length = float(np.linalg.norm(along))
    along /= length
    offset = rises - first
    off = np.abs(offset @ np.array([along[1], -along[0]]))
    at = (offset @ along)[off < 2 * config.cell]
    count = max(round(length / config.cell), 1)
    cells = np.unique((at[(at >= 0) & (at < length)] / length * count).astype(np.int64))
    return len(cells) >= config.shown * count
