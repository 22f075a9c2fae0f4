"""Cells of a table's plan, and what is highest in each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import BinsConfig
from brrp_cli.geometry import bounds
from brrp_cli.hulls import convex_hull, in_hull

Cells = NDArray[np.bool_]

AROUND = np.ones((3, 3), dtype=bool)


@dataclass(frozen=True)
class PlanCells:
    """Cells of the plan: `tops` (h, w) metres of what is highest in each, -inf where nothing is
    seen; `origin` (2,) of cell (0, 0)."""

    tops: NDArray[np.float64]
    origin: NDArray[np.float64]
    cell: float

    @cached_property
    def middles(self) -> NDArray[np.float64]:
        """(h w, 2) of the cells, metres."""
        rows, columns = np.indices(self.tops.shape)
        return self.origin + (np.stack([rows, columns], -1).reshape(-1, 2) + 0.5) * self.cell

    @cached_property
    def in_view(self) -> Cells:
        """Cells that the image shows, or that something hides."""
        hull = self.hull(np.isfinite(self.tops))
        return np.zeros_like(self.tops, bool) if hull is None else self.filled(hull, -2 * self.cell)

    def hull(self, cells: Cells) -> NDArray[np.float64] | None:
        """(m, 3) around the middles of some cells."""
        return convex_hull(self.middles[cells.ravel()])

    def filled(self, hull: NDArray[np.float64], margin: float) -> Cells:
        """The cells in a hull that is grown by `margin` metres."""
        return in_hull(hull, self.middles, margin).reshape(self.tops.shape)


def plan_cells(
    plan: NDArray[np.floating], height: NDArray[np.floating], config: BinsConfig
) -> PlanCells | None:
    """The cells of points on and above a table; None of a table that is too large, or without any.

    plan : (n, 2) metres, on the table; height : (n,) metres above it
    """
    some = slice(None, None, max(len(plan) // config.points, 1))
    plan, height = plan[some], height[some]
    known = np.abs(height) < config.most_height
    points = np.asarray(plan[known], np.float64)
    if not known.any():
        return None
    origin, last = bounds(points)
    if (last - origin).max() > config.widest:
        return None
    rows, columns = ((points - origin) / config.cell).astype(np.int64).T
    tops = np.full((rows.max() + 1, columns.max() + 1), -np.inf)
    # NumPy is fast at this with one index alone.
    np.maximum.at(tops.reshape(-1), rows * tops.shape[1] + columns, height[known])
    return PlanCells(tops, origin, config.cell)
