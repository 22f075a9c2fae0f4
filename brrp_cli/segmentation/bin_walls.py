"""The walls of bins as solids."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import BinsConfig
from brrp_cli.hulls import in_hull
from brrp_cli.segmentation.bins import Bin
from brrp_cli.segmentation.outlines import corners_of, normals_of, plain, shifted
from brrp_cli.segmentation.table_plane import Table

Array = NDArray[np.float64]
# Corners (8, 3) of a convex solid, metres, camera frame.
Solid = Array


def bins_of(
    table: Table, points: Array, masked: NDArray[np.bool_], config: BinsConfig
) -> list[list[Solid]]:
    """The walls of each bin on the table, from the table up to its rim.

    A bin that has a mask is an object, and none of these. A side of which no rim is seen, as where
    the image's border cuts a bin, has no wall.

    points : (n, 3) metres, camera frame; masked : (n,) those that have a mask
    """
    plan, height = table.plan(points), table.plane.signed_distance(points)
    found = []
    for each in table.bins:
        there = in_hull(each.outside, plan, 0.0) & (height > config.low)
        walls = there.copy()
        walls[there] = Table(table.plane, table.axes, table.hull, (each,)).bin_walls(
            plan[there], height[there] - each.floor, config
        )
        if not walls.any() or masked[walls].mean() < config.masked:
            found.append(walls_of(each, table, plan[there], height[there], config))
    return found


def walls_of(
    each: Bin, table: Table, plan: Array, height: Array, config: BinsConfig
) -> list[Solid]:
    """One wall, `config.board` thick, for each side of a bin's outline; all lean alike.

    plan : (n, 2) of points; height : (n,) of them above the table's plane
    """
    half = config.board / 2
    # Cells that hold the rim's edge reach beyond it, by half of one on average.
    rim = each.outside + np.array([0.0, 0.0, each.around + config.cell / 2])
    outline = plain(corners_of(rim), config.corners, config.cell)
    foot = _lean(outline, each, config) * each.rim
    faces = ((half, each.rim), (-half, each.rim), (half - foot, 0.0), (-half - foot, 0.0))
    rings = [table.at(shifted(outline, out), level) for out, level in faces]
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
