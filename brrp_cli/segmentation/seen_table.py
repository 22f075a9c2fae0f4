"""The table that a frame shows, with the bins and platforms on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import WallConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.hulls import beyond_hull
from brrp_cli.observation.support_plane import Plane, nearest_plane
from brrp_cli.observation.walls import Wall
from brrp_cli.segmentation.beyond_image import beyond_image
from brrp_cli.segmentation.bins import find_bins
from brrp_cli.segmentation.plan_cells import plan_cells
from brrp_cli.segmentation.platforms import find_platforms, on_platforms
from brrp_cli.segmentation.standing_beside import Seen, with_things_beside
from brrp_cli.segmentation.table_plane import Table, find_table


@dataclass(frozen=True)
class SeenTable:
    """A table, and where points lie over it; NaN where there is no depth.

    plan : (H, W, 2) metres, on it; height : (H, W) metres above what lies beneath: it, a bin's
    floor or a platform; beside :
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
    table = _with_what_is_on_it(table, points[near], plan[near], config)
    height = table.plane.signed_distance(points) if table.platforms else height
    beyond = beyond_image(plan, flat, config.table)
    if beyond is not None:
        outside = beside > 0
        beside[outside] = np.minimum(beside[outside], beyond_hull(beyond, plan[outside]))
    for wall in table.walls:
        if not wall.spans and _fills_border(wall, points, valid, walls):
            off |= wall.holds(points, walls.near)
    beside[off] = np.inf
    return SeenTable(table, plan, table.above_floors(plan, height), beside)


def _with_what_is_on_it(
    table: Table,
    points: NDArray[np.floating],
    plan: NDArray[np.float64],
    config: SegmentConfig,
) -> Table:
    """The table with bins and platforms that points (n, 3) on and above it show; plan : (n, 2)."""
    cells = plan_cells(plan, table.plane.signed_distance(points), config.bins)
    if cells is None:
        return table
    platforms = find_platforms(cells, config.platforms)
    # The table's plane is that of thin ones as well, until they are known.
    for _ in range(config.platforms.rounds if platforms else 0):
        flat = np.abs(table.plane.signed_distance(points)) < config.table.tolerance
        for each in platforms:
            flat &= ~each.holds(plan)
        if flat.sum() < config.table.min_points:
            break
        plane = Plane.facing_the_camera(nearest_plane(points[flat].astype(np.float64)))
        again = plan_cells(plan, plane.signed_distance(points), config.bins)
        found = () if again is None else find_platforms(again, config.platforms)
        if again is None or not found:
            break
        table, cells, platforms = replace(table, plane=plane), again, found
    bins = find_bins(on_platforms(cells, platforms), config.bins)
    return replace(table, bins=bins, platforms=platforms)


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
