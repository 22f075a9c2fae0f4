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
from brrp_cli.observation.patches import Patch
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.bin_walls import Solid, bins_of
from brrp_cli.segmentation.outlines import corners_of, plain
from brrp_cli.segmentation.seen_surfaces import smoothed
from brrp_cli.segmentation.seen_table import see_table
from brrp_cli.segmentation.table_plane import Table

log = logging.getLogger(__name__)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Furniture:
    """Corners (k, 3) of convex solids, metres.

    bins : the walls of each on the table; walls : those behind it, and the back, the sides and the
    upper board of a shelf
    """

    bins: list[list[Solid]] = field(default_factory=list)
    walls: list[Solid] = field(default_factory=list)

    def moved(self, T: Array) -> Furniture:
        """In another frame, by a rigid T (4, 4)."""

        def move(corners: Solid) -> Solid:
            return np.asarray(transform_points(T, corners), dtype=np.float64)

        return Furniture(
            [[move(wall) for wall in walls] for walls in self.bins], [*map(move, self.walls)]
        )

    @property
    def solids(self) -> list[Solid]:
        """All of them."""
        return [wall for walls in (*self.bins, self.walls) for wall in walls]


def furniture(frame: Frame, plane: Plane | None, seed: int, config: SegmentConfig) -> Furniture:
    """What stands around the objects of a frame, camera frame. plane : that they stand on; where
    the table seen is another one, nothing is known.

    What has a mask is an object, and none of it. A side of a bin of which no rim is seen, as where
    the image's border cuts it, has no wall.
    """
    points = backproject(smoothed(frame, config), frame.K)
    try:
        table = see_table(points, frame.K, seed, frame.source, config).table
    except FrameError as error:
        log.info("No table was found, and so nothing around it: %s", error.what)
        return Furniture()
    own = frame.points[frame.valid & (frame.segmap != BACKGROUND)]
    if plane is None or not _same(plane, table, own, config):
        return Furniture()
    valid = np.isfinite(points[..., 2])
    masked = frame.segmap[valid] != BACKGROUND
    seen = np.asarray(points[valid], dtype=np.float64)
    return Furniture(bins_of(table, seen, masked, config.bins), _walls(table, seen, masked, config))


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


def _same(plane: Plane, table: Table, own: NDArray[np.floating], config: SegmentConfig) -> bool:
    """Whether a plane is the table's, or a floor of a bin on it, where points (n, 3) of the
    objects, metres, camera frame, lie."""
    if not len(own):
        return False
    above = float(np.median(table.plane.signed_distance(own) - plane.signed_distance(own)))
    floors = [0.0, *(each.floor for each in table.bins)]
    return min(abs(above - floor) for floor in floors) < config.table.support.low


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
        _slab(face, wall.thick, config)
        for face, there in zip(faces, near, strict=True)
        if not there.any() or masked[there].mean() < config.bins.masked
    ]


def _slab(face: Patch, thick: float, config: SegmentConfig) -> Solid:
    outline = plain(corners_of(face.hull), config.bins.corners, config.bins.cell)
    return np.concatenate(
        [
            outline @ face.axes + (level - face.plane.offset) * face.plane.normal
            for level in (0.0, -thick)
        ]
    )
