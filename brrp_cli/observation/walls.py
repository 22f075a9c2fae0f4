"""What shuts a table off: a wall behind it, the back, the sides and the upper board of a shelf."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import SupportConfig, WallConfig
from brrp_cli.geometry import normalise
from brrp_cli.observation.patches import Patch, patch_of

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Wall:
    """An upright plane at which a table ends.

    patch : what is seen of it; outside : whether the table lies behind it, as it does behind the
    outer face of a shelf's side; spans : whether it is long and goes along the table
    """

    patch: Patch
    outside: bool
    spans: bool

    def holds(self, points: Array, near: float) -> NDArray[np.bool_]:
        """(...,) which of points (..., 3), metres, camera frame, are the wall or lie behind it:
        nearer to it than `near` metres, which beyond a depth of one grow with its square. Of one
        that is seen from outside, those that are near alone."""
        height = self.patch.plane.signed_distance(points)
        far = near * np.maximum(points[..., 2], 1.0) ** 2
        return np.asarray((np.abs(height) if self.outside else height) < far)


@dataclass(frozen=True)
class Board:
    """A board over a table. patch : the face that is seen; height : metres above the table's plane,
    of its lower face"""

    patch: Patch
    height: float


def walls_of(
    table: Patch,
    patches: Sequence[Patch],
    points: Array,
    config: WallConfig,
    support: SupportConfig,
) -> tuple[Wall, ...]:
    """The upright ones of the patches that have all of the table on one side.

    So a box on a table is no wall: the table goes on behind its sides.

    points : (n, 3) metres, camera frame, of all of them and of other things
    """
    flat = _on(table, points, config.near)
    found = []
    for patch in patches:
        if abs(patch.plane.normal @ table.plane.normal) > np.sin(np.radians(config.square)):
            continue
        # Front edges of a shelf are none: things reach through them.
        if not patch.is_whole(points, support):
            continue
        off = patch.plane.signed_distance(flat)
        # The corner itself is near to both.
        clear = off[np.abs(off) >= config.near]
        in_front = float((clear > 0).mean()) if len(clear) else 0.5
        if 1 - config.in_front < in_front < config.in_front:
            continue
        wall = points[np.abs(patch.plane.signed_distance(points)) < config.near]
        rises = wall[table.plane.signed_distance(wall) > config.near]
        along = normalise(np.cross(table.plane.normal, patch.plane.normal))
        # A face of a thing may go along all of a table that shows little of itself.
        spans = patch.across >= support.across
        spans &= _covers(rises @ along, flat @ along, config) >= config.spans
        found.append(Wall(patch, in_front < 0.5, spans))
    return tuple(found)


def board_over(
    table: Patch,
    patches: Sequence[Patch],
    points: Array,
    config: WallConfig,
    support: SupportConfig,
) -> Board | None:
    """The lowest of the patches that cover the table as the next board of a shelf does.

    points : (n, 3) metres, camera frame, of all of them and of other things
    """
    flat = table.plan(_on(table, points, config.near))
    found = []
    for patch in patches:
        alike = patch.plane.normal @ table.plane.normal
        if patch is table or abs(alike) < np.cos(np.radians(config.square)):
            continue
        if not patch.is_whole(points, support):
            continue
        near = points[np.abs(patch.plane.signed_distance(points)) < config.near]
        height = float(np.median(table.plane.signed_distance(near))) if len(near) else 0.0
        if height < config.board_above:
            continue
        below = near - height * table.plane.normal
        shadow = patch_of(table.plane, below, config.near, config.cell)
        if shadow is not None and shadow.holds(flat, 0.0).mean() >= config.covers:
            found.append(Board(patch, height if alike < 0 else height - config.board))
    return min(found, key=lambda board: board.height, default=None)


def _on(table: Patch, points: Array, near: float) -> Array:
    flat = points[np.abs(table.plane.signed_distance(points)) < near]
    return flat[table.holds(table.plan(flat), 0.0)]


def _covers(some: Array, others: Array, config: WallConfig) -> float:
    """The share of the cells from end to end of `others` (n,), metres, that hold some of (m,)."""
    low, high = np.percentile(others, (config.strays, 100 - config.strays))
    count = max(int(np.ceil((high - low) / config.cell)), 1)
    inside = some[(some >= low) & (some < high)]
    return len(np.unique(((inside - low) / config.cell).astype(np.int64))) / count
