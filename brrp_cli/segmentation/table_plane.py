"""The table of a frame without masks: which plane supports the objects, and how far it reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import BinsConfig, TableConfig
from brrp_cli.errors import FrameError
from brrp_cli.hulls import beyond_hull, in_hull
from brrp_cli.observation.borne import bearing
from brrp_cli.observation.lowered import lowered
from brrp_cli.observation.outlined import Outlined
from brrp_cli.observation.patches import Ransac, largest_planes, patch_with_hidden
from brrp_cli.observation.support_plane import Plane
from brrp_cli.observation.walls import Board, Wall, board_over, walls_of
from brrp_cli.seeds import child_rng
from brrp_cli.segmentation.bins import Bin
from brrp_cli.segmentation.platforms import Platform


@dataclass(frozen=True)
class Table(Outlined):
    """A support plane with its extent.

    bins, platforms : on the table; they count as part of it
    walls : at which it ends; board : over it
    """

    bins: tuple[Bin, ...] = ()
    platforms: tuple[Platform, ...] = ()
    walls: tuple[Wall, ...] = ()
    board: Board | None = None

    @property
    def walled(self) -> bool:
        """Whether a bin stands on it, or a wall or a shelf shuts it off."""
        return bool(self.bins) or self.board is not None or any(w.spans for w in self.walls)

    @property
    def furnished(self) -> bool:
        """Whether there is more than a table: walls, or platforms on it."""
        return self.walled or bool(self.platforms)

    def height(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """(...,) metres above what lies beneath points (..., 3): the table, the floor of a bin, or
        a platform."""
        height = self.plane.signed_distance(points)
        return self.above_floors(self.plan(points), height) if self.on_it else height

    @property
    def on_it(self) -> bool:
        """Whether a bin or a platform is on it."""
        return bool(self.bins or self.platforms)

    def above_floors(
        self, plan: NDArray[np.floating], height: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(...,) metres above the table, the floor of a bin or a platform, of plan points (..., 2)
        at `height` (...,) above the table's plane."""
        above, flat = height.copy(), plan.reshape(-1, 2)
        found = above.reshape(-1)
        for each in self.bins:
            found[in_hull(each.outside, flat, 0.0)] -= each.floor
        for platform in self.platforms:
            near = np.flatnonzero(platform.holds(flat))
            # What lies between the table and its upper face is its edge.
            found[near] -= np.clip(found[near], 0.0, platform.height)
        return above

    def bin_walls(
        self, plan: NDArray[np.floating], height: NDArray[np.floating], config: BinsConfig
    ) -> NDArray[np.bool_]:
        """(n,) which of plan points (n, 2) at `height` (n,) are a bin's walls, not what it holds.

        A wall leans outwards by a little, so that it is near the rim; what rises over the rim, or
        lies over the floor that is seen, is no wall.
        """
        walls = np.zeros(len(plan), dtype=bool)
        for each in self.bins:
            near = np.flatnonzero(in_hull(each.outside, plan, config.bled))
            below = each.rim - each.floor - height[near]
            reach = each.around + config.thick + config.lean * np.maximum(below, 0.0)
            wall = (below > -config.over) & (-beyond_hull(each.outside, plan[near]) < reach)
            wall &= ~in_hull(each.inside, plan[near], 0.0)
            walls[near[wall]] = True
        return walls


def find_table(
    points: NDArray[np.floating],
    seed: int,
    source: object,
    config: TableConfig,
) -> Table:
    """The support plane of points (n, 3), metres, camera frame; bins are not looked for.

    The planes with most points are found one after the other (RANSAC). The table is the largest,
    or, where a floor is larger, a plane that lies well above it, is parallel to it and has a good
    part of its points; or that one on which most stands (observation/borne.py).

    source : for messages. Errors: FrameError if no plane holds `config.least` of the points.
    """
    if len(points) > config.points:
        drawn = child_rng(seed, "table").choice(len(points), config.points, replace=False)
        points = points[drawn]
    exact = np.asarray(points, dtype=np.float64)
    ransac = Ransac(config.tolerance, config.iterations, config.ransac_points, config.min_points)
    planes = largest_planes(exact, seed, config.support, ransac)
    if not planes or planes[0][1] < config.least * len(points):
        raise FrameError(
            "No support plane was found",
            where=source,
            expected="a table that fills a good part of the image",
            found=f"no plane with {config.least:.0%} of the points",
            fix="check the unit of depth (--depth-scale), take the picture so that more of the"
            " table is seen, or pass masks with --masks",
        )
    number = _above_the_floor(planes, config)
    plane, count = planes[number]
    planes[number] = lowered(plane, exact, seed, config.heap, ransac), count
    patches = {
        index: patch
        for index, (plane, _) in enumerate(planes)
        if (patch := patch_with_hidden(plane, points, config.tolerance, config.support)) is not None
    }
    usual = patches.get(number)
    if usual is None:
        raise FrameError("The support plane has no extent", where=source)
    found = list(patches.values())
    table = bearing(found, usual, points, None, config.support)
    return Table(
        table.plane,
        table.axes,
        table.hull,
        walls=walls_of(table, found, points, config.wall, config.support),
        board=board_over(table, found, points, config.wall, config.support),
    )


def _above_the_floor(planes: list[tuple[Plane, int]], config: TableConfig) -> int:
    """The number of the largest plane, or of one that lies well above it as a table on a floor."""
    largest, size = planes[0]
    table, number = largest, 0
    for index, (plane, count) in enumerate(planes[1:], start=1):
        parallel = plane.normal @ largest.normal > np.cos(np.radians(config.parallel))
        # Offsets are the camera's heights above the planes. What rises less than a table's legs
        # are long is the tops of things on the table.
        higher = table.offset - plane.offset > config.height
        if parallel and count >= config.of_floor * size and higher:
            table, number = plane, index
    return number
