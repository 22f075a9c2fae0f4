"""The table that a frame shows, with the bins on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import WallConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.hulls import beyond_hull
from brrp_cli.observation.walls import Wall
from brrp_cli.segmentation.beyond_image import beyond_image
from brrp_cli.segmentation.bins import find_bins
from brrp_cli.segmentation.standing_beside import Seen, with_things_beside
from brrp_cli.segmentation.table_plane import Table, find_table


@dataclass(frozen=True)
class SeenTable:
    """A table, and where points lie over it; NaN where there is no depth.

    plan : (H, W, 2) metres, on it; height : (H, W) metres above it or a floor of a bin; beside :
    (H, W) metres beside it and beside what of it lies beyond the image, 0 or less on it, infinite
    on what shuts it off
    """

    table: Table
    plan: NDArray[np.float64]
    height: NDArray[np.float64]
    beside: NDArray[np.float64]


def see_table(
    points: NDArray[np.floating],
    K: NDArray[np.floating],
    seed: int,
    source: object,
    config: SegmentConfig,
) -> SeenTable:
    """The table of points (H, W, 3), metres, camera frame, NaN = none.

    K : (3, 3) of the camera
    source : for messages. Errors: FrameError if there is no table.
    """
    valid = np.isfinite(points[..., 2])
    table = find_table(points[valid], seed, source, config.table)
    plan, height = table.plan(points), table.plane.signed_distance(points)
    beside = table.beside(plan)
    walls = config.table.wall
    off = np.zeros(valid.shape, dtype=bool)
    for wall in table.walls:
        if wall.spans:
            off |= wall.holds(points, walls.near)
    if table.board is not None:
        off |= height > table.board.height - walls.near
    flat = (np.abs(height) < config.table.tolerance) & (beside <= 0)
    seen = Seen(table, points, plan, height, beside, off, K)
    hull = with_things_beside(seen, config.table.tolerance, config.table.bare)
    if hull is not table.hull:
        table = replace(table, hull=hull)
        beside = np.minimum(beside, table.beside(plan))
    near = (beside <= config.bins.beside) & ~off
    table = replace(table, bins=find_bins(plan[near], height[near], config.bins))
    beyond = beyond_image(plan, flat, config.table)
    if beyond is not None:
        outside = beside > 0
        beside[outside] = np.minimum(beside[outside], beyond_hull(beyond, plan[outside]))
    for wall in table.walls:
        if not wall.spans and _fills_border(wall, points, valid, walls):
            off |= wall.holds(points, walls.near)
    beside[off] = np.inf
    return SeenTable(table, plan, table.above_floors(plan, height), beside)


def _fills_border(
    wall: Wall, points: NDArray[np.floating], valid: NDArray[np.bool_], config: WallConfig
) -> bool:
    """Whether a wall fills much of the image's border: what ends within the image, and before the
    table does, is a box, or a thing behind it."""
    near = np.abs(wall.patch.plane.signed_distance(points)) < config.near
    border = valid.copy()
    width = config.border_width
    border[width:-width, width:-width] = False
    return bool(border.any() and near[border].mean() >= config.border)
