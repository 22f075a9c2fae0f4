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
    points: NDArray[np.floating], seed: int, source: object, config: SegmentConfig
) -> SeenTable:
    """The table of points (H, W, 3), metres, camera frame, NaN = none.

    source : for messages. Errors: FrameError if there is no table.
    """
    valid = np.isfinite(points[..., 2])
    table = find_table(points[valid], seed, source, config.table)
    plan, height = table.plan(points), table.plane.signed_distance(points)
    beside = table.beside(plan)
    walls = config.table.wall
    shut = [wall for wall in table.walls if _shuts_off(wall, points, valid, walls)]
    off = np.zeros(valid.shape, dtype=bool)
    for wall in shut:
        off |= wall.holds(points, walls.near)
    if table.board is not None:
        off |= height > table.board.height - walls.near
    near = (beside <= config.bins.beside) & ~off
    bins = find_bins(plan[near], height[near], config.bins)
    table = replace(table, walls=tuple(shut), bins=bins)
    flat = (np.abs(height) < config.table.tolerance) & (beside <= 0)
    beyond = beyond_image(plan, flat, config.table)
    if beyond is not None:
        outside = beside > 0
        beside[outside] = np.minimum(beside[outside], beyond_hull(beyond, plan[outside]))
    beside[off] = np.inf
    return SeenTable(table, plan, table.above_floors(plan, height), beside)


def _shuts_off(
    wall: Wall, points: NDArray[np.floating], valid: NDArray[np.bool_], config: WallConfig
) -> bool:
    """What ends within the image, and before the table does, is a box, or a thing behind it."""
    near = np.abs(wall.patch.plane.signed_distance(points)) < config.near
    return wall.spans or _of_border(near, valid, config.border_width) >= config.border


def _of_border(mask: NDArray[np.bool_], valid: NDArray[np.bool_], width: int) -> float:
    """The share of the pixels with depth along the image's border, `width` pixels of it, that a
    mask (H, W) holds."""
    border = valid.copy()
    border[width:-width, width:-width] = False
    return float(mask[border].mean()) if border.any() else 0.0
