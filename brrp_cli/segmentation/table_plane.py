"""The table of a frame without masks: which plane supports the objects, and how far it reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import WallConfig
from brrp_cli.config.table import BinsConfig, TableConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.observation.support_plane import Plane, largest_plane
from brrp_cli.observation.walls import is_wall
from brrp_cli.seeds import child_rng, child_seed
from brrp_cli.segmentation.bins import Bin
from brrp_cli.segmentation.hulls import beyond_hull, convex_hull, in_hull


@dataclass(frozen=True)
class Table:
    """A support plane with its extent.

    plane : the objects' side, which is the camera's, is positive
    axes : (2, 3) float64, unit, spanning the plane: plan coordinates are points @ axes.T
    hull : (m, 3) float64: plan points p with hull[:, :2] @ p + hull[:, 2] <= 0 lie on the table
    bins : on the table; they count as part of it
    backs : upright planes behind it, turned to the camera
    """

    plane: Plane
    axes: NDArray[np.float64]
    hull: NDArray[np.float64]
    bins: tuple[Bin, ...] = ()
    backs: tuple[Plane, ...] = ()

    def plan(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Plan coordinates (..., 2), metres, of points (..., 3), camera frame."""
        return np.asarray(points @ self.axes.T, dtype=np.float64)

    def holds(self, plan: NDArray[np.floating], margin: float) -> NDArray[np.bool_]:
        """(n,) whether plan points (n, 2) lie on the table or at most `margin` beside it."""
        return in_hull(self.hull, plan, margin)

    def beside(self, plan: NDArray[np.floating]) -> NDArray[np.float64]:
        """(...,) how far beside the table plan points (..., 2) lie, metres; 0 or less on it."""
        return beyond_hull(self.hull, plan.reshape(-1, 2)).reshape(plan.shape[:-1])

    def height(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """(...,) metres above the table, or above the floor of a bin, of points (..., 3)."""
        height = self.plane.signed_distance(points)
        return self.above_floors(self.plan(points), height) if self.bins else height

    def above_floors(
        self, plan: NDArray[np.floating], height: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(...,) metres above the table, or above the floor of a bin, of plan points (..., 2) at
        `height` (...,) above the table's plane."""
        above, flat = height.copy(), plan.reshape(-1, 2)
        for each in self.bins:
            above.reshape(-1)[in_hull(each.outside, flat, 0.0)] -= each.floor
        return above

    def walls(
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

    The planes with most points are found one after the other (RANSAC). The table is the largest
    that is no wall (observation/walls.py), or, where a floor is larger, a plane that lies well
    above it, is parallel to it and has a good part of its points.

    source : for messages. Errors: FrameError if no plane holds `config.least` of the points.
    """
    if len(points) > config.points:
        drawn = child_rng(seed, "table").choice(len(points), config.points, replace=False)
        points = points[drawn]
    planes = _largest_planes(points.astype(np.float64), seed, config)
    if not planes:
        raise FrameError(
            "No support plane was found",
            where=source,
            expected="a table that fills a good part of the image",
            found=f"no plane with {config.least:.0%} of the points",
            fix="check the unit of depth (--depth-scale), take the picture so that more of the"
            " table is seen, or pass masks with --masks",
        )
    backs, rest = _walls_and_rest(planes, points, config.wall)
    plane = _above_the_floor(rest, config)
    axes = np.linalg.svd(plane.normal[None])[2][1:]
    on = (points @ axes.T)[np.abs(plane.signed_distance(points)) < config.tolerance]
    hull = convex_hull(_largest_patch(on, config.cell))
    if hull is None:
        raise FrameError("The support plane has no extent", where=source)
    return Table(plane=plane, axes=axes, hull=hull, backs=backs)


def _largest_planes(
    points: NDArray[np.float64], seed: int, config: TableConfig
) -> list[tuple[Plane, int]]:
    """Planes with `config.least` of the points, most points first, camera side positive."""
    planes: list[tuple[Plane, int]] = []
    rest = points
    least = config.least * len(points)
    for index in range(config.candidates):
        # What is left could be neither a plane nor a table above the floor that was found.
        if len(rest) < max(least, config.of_floor * max((n for _, n in planes), default=0)):
            break
        model = largest_plane(
            rest,
            child_seed(seed, "table", index),
            tolerance=config.tolerance,
            iterations=config.iterations,
            drawn_points=config.ransac_points,
            min_points=config.min_points,
        )
        if model is None:
            break
        model = model if model[3] > 0 else -model
        plane = Plane(model[:3], float(model[3]))
        inlier = np.abs(plane.signed_distance(rest)) < config.tolerance
        if inlier.sum() < least:
            break
        planes.append((plane, int(inlier.sum())))
        rest = rest[~inlier]
    return sorted(planes, key=lambda pair: -pair[1])


def _walls_and_rest(
    planes: list[tuple[Plane, int]], points: NDArray[np.floating], config: WallConfig
) -> tuple[tuple[Plane, ...], list[tuple[Plane, int]]]:
    """Those of the planes that are walls behind one of the others, and the others."""
    walls = [
        any(is_wall(plane, table, points, points, config) for table, _ in planes)
        for plane, _ in planes
    ]
    rest = [pair for pair, wall in zip(planes, walls, strict=True) if not wall]
    # In a niche each of three could be the wall of the next.
    if not rest:
        return (), planes
    return tuple(plane for (plane, _), wall in zip(planes, walls, strict=True) if wall), rest


def _above_the_floor(planes: list[tuple[Plane, int]], config: TableConfig) -> Plane:
    largest, size = planes[0]
    table = largest
    for plane, count in planes[1:]:
        parallel = plane.normal @ largest.normal > np.cos(np.radians(config.parallel))
        # Offsets are the camera's heights above the planes. What rises less than a table's legs
        # are long is the tops of things on the table.
        higher = table.offset - plane.offset > config.height
        if parallel and count >= config.of_floor * size and higher:
            table = plane
    return table


def _largest_patch(plan: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Those of the plan points (n, 2) that hang together: a floor beyond the edge is no table."""
    ndimage = import_library("scipy.ndimage")
    cells = np.floor(plan / cell).astype(np.int64)
    cells -= cells.min(axis=0)
    grid = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    # Objects hide parts of the table behind them: patches up to 8 cm apart are one.
    joined, _ = ndimage.label(ndimage.binary_dilation(grid, iterations=2))
    patch = joined[tuple(cells.T)]
    return plan[patch == np.bincount(patch).argmax()]
