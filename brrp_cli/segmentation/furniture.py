"""What stands on a table and shuts it off, as solids: also where nothing shows them, a hand does
not go through them."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.config.tables import changed
from brrp_cli.errors import ConfigError, FrameError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject, transform_points
from brrp_cli.observation.outlined import Outlined
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.bin_walls import Solid, bins_of
from brrp_cli.segmentation.outlines import corners_of, plain
from brrp_cli.segmentation.seen_surfaces import smoothed_depth
from brrp_cli.segmentation.seen_table import see_table
from brrp_cli.segmentation.table_plane import Table

log = logging.getLogger(__name__)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Furniture:
    """Corners (k, 3) of convex solids, metres.

    bins : the walls of each on the table; platforms : on it; walls : those behind it, and the back,
    the sides and the upper board of a shelf
    beneath : metres by which the table lies below the plane that was asked about, which is that of
    a platform on it
    """

    bins: list[list[Solid]] = field(default_factory=list)
    walls: list[Solid] = field(default_factory=list)
    platforms: list[Solid] = field(default_factory=list)
    beneath: float = 0.0

    def moved(self, T: Array) -> Furniture:
        """In another frame, by a rigid T (4, 4)."""

        def move(corners: Solid) -> Solid:
            return np.asarray(transform_points(T, corners), dtype=np.float64)

        return Furniture(
            [[move(wall) for wall in walls] for walls in self.bins],
            [*map(move, self.walls)],
            [*map(move, self.platforms)],
            self.beneath,
        )

    @property
    def solids(self) -> list[Solid]:
        """All of them."""
        return [solid for solids in (*self.bins, self.platforms, self.walls) for solid in solids]

    def table(self, plane: Plane) -> Plane:
        """The table's plane, where `plane` was asked about."""
        return Plane(plane.normal, plane.offset + self.beneath)


def furniture(frame: Frame, plane: Plane | None, seed: int, config: SegmentConfig) -> Furniture:
    """What stands around the objects of a frame, camera frame. plane : that they stand on; where
    the table seen is another one, nothing is known.

    What has a mask is an object, and none of it. A side of a bin of which no rim is seen, as where
    the image's border cuts it, has no wall.
    """
    points = backproject(smoothed_depth(frame, config), frame.K)
    try:
        table = see_table(points, frame.K, seed, frame.source, config).table
    except FrameError as error:
        log.info("No table was found, and so nothing around it: %s", error.what)
        return Furniture()
    own = frame.points[frame.valid & (frame.segmap != BACKGROUND)]
    if plane is None or not len(own):
        return Furniture()
    above = float(np.median(table.plane.signed_distance(own) - plane.signed_distance(own)))
    tops = [each.height for each in table.platforms]
    levels = [*tops, 0.0, *(each.floor for each in table.bins)]
    off = np.abs(above - np.array(levels))
    nearest = int(off.argmin())
    if off[nearest] >= config.table.support.low:
        return Furniture()
    valid = np.isfinite(points[..., 2])
    masked = frame.segmap[valid] != BACKGROUND
    seen = np.asarray(points[valid], dtype=np.float64)
    platforms = _platforms(table, seen, masked, config)
    on_platform = nearest < len(tops) and platforms[nearest] is not None
    return Furniture(
        bins_of(table, seen, masked, config.bins),
        _walls(table, seen, masked, config),
        [each for each in platforms if each is not None],
        above if on_platform else 0.0,
    )


def segmentation_of(table: dict[str, Any] | None) -> SegmentConfig:
    """How masks were made, as results tell it; the defaults where they came with the frame, or
    where another version made them that knew other numbers."""
    try:
        return changed(SegmentConfig(), table or {}, "the results", "segmentation.")
    except ConfigError as error:
        log.warning(
            "Another version made the masks (%s): bins and walls are looked for with the defaults",
            error.where,
        )
        return SegmentConfig()


def _platforms(
    table: Table, points: Array, masked: NDArray[np.bool_], config: SegmentConfig
) -> list[Solid | None]:
    """Each platform, from its upper face down to the table; None for one that has a mask, and is an
    object."""
    plan, height = table.plan(points), table.plane.signed_distance(points)
    found: list[Solid | None] = []
    for each in table.platforms:
        there = np.abs(height - each.height) < config.platforms.band
        there[there] = each.holds(plan[there])
        # Cells that hold its edge reach beyond it, by half of one on average.
        out = config.platforms.around - config.bins.cell / 2
        hull = each.outside + np.array([0.0, 0.0, out])
        own = not there.any() or masked[there].mean() < config.bins.masked
        found.append(_prism(table, hull, (each.height, 0.0), config) if own else None)
    return found


def _walls(
    table: Table, points: Array, masked: NDArray[np.bool_], config: SegmentConfig
) -> list[Solid]:
    """A slab behind each face that is seen of what shuts a table off."""
    wall = config.table.wall
    faces = [each.patch for each in table.walls if each.spans]
    if table.board is not None:
        faces.append(table.board.patch)
    near = [np.abs(face.plane.signed_distance(points)) < wall.near for face in faces]
    return [
        _prism(face, face.hull, (0.0, -wall.thick), config)
        for face, there in zip(faces, near, strict=True)
        if not there.any() or masked[there].mean() < config.bins.masked
    ]


def _prism(
    part: Outlined, hull: Array, levels: tuple[float, float], config: SegmentConfig
) -> Solid:
    """What lies between two levels, metres above a plane, within an outline (m, 3) on it."""
    outline = plain(corners_of(hull), config.bins.corners, config.bins.cell)
    return np.concatenate([part.at(outline, level) for level in levels])
