"""Bins, totes and trays on the table: walls of one height around a floor on which objects lie.

In cells of the table's plan, what is highest in each shows their rim as a thin line of one height,
along most of its own convex hull. Things inside, and gaps where depth is missing, do not matter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import BinsConfig
from brrp_cli.dependencies import import_library
from brrp_cli.segmentation.hulls import convex_hull, in_hull

Cells = NDArray[np.bool_]


@dataclass(frozen=True)
class Bin:
    """A bin on the table; hulls as `Table.hull`, in its plan.

    inside : hull (m, 3) of the floor; outside : hull (m, 3) around the walls
    floor, rim : metres of the floor and of the walls' upper end above the table's plane
    """

    inside: NDArray[np.float64]
    outside: NDArray[np.float64]
    floor: float
    rim: float


@dataclass(frozen=True)
class _Plan:
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


def find_bins(
    plan: NDArray[np.floating], height: NDArray[np.floating], config: BinsConfig
) -> tuple[Bin, ...]:
    """The bins that points on and above the table show, those with the most complete rim first.

    plan : (n, 2) metres, on the table; height : (n,) metres above it
    """
    some = slice(None, None, max(len(plan) // config.points, 1))
    plan, height = plan[some], height[some]
    known = np.abs(height) < config.most_height
    if not known.any():
        return ()
    cells = _cells(np.asarray(plan[known], np.float64), height[known], config.cell)
    bins: list[Bin] = []
    taken = np.zeros(cells.tops.shape, dtype=bool)
    for _, rim, ring in sorted(_rings(cells, config), key=lambda found: -found[0]):
        region = cells.filled(ring, config.cell / 2)
        if (region & taken).any():
            continue
        found = _bin(cells, ring, rim, config)
        if found is not None:
            taken |= region
            bins.append(found)
    return tuple(bins)


def _cells(plan: NDArray[np.float64], height: NDArray[np.float64], cell: float) -> _Plan:
    origin = plan.min(axis=0)
    index = ((plan - origin) / cell).astype(np.int64)
    tops = np.full(index.max(axis=0) + 1, -np.inf)
    np.maximum.at(tops, (index[:, 0], index[:, 1]), height)
    return _Plan(tops, origin, cell)


def _rings(cells: _Plan, config: BinsConfig) -> Iterator[tuple[float, float, NDArray[np.float64]]]:
    """What may be rims, at all heights: how complete each is, its height, and its hull."""
    ndimage = import_library("scipy.ndimage")
    around = np.ones((3, 3), dtype=bool)
    for height in np.arange(config.least_height, config.most_height, config.step):
        band = np.abs(cells.tops - height) <= config.band
        if band.sum() * config.cell**2 < config.least_rim:
            continue
        # Gaps of a few cells are pixels without depth.
        labels, count = ndimage.label(ndimage.binary_dilation(band, around, config.gap), around)
        for label in range(1, count + 1):
            hull = cells.hull(band & (labels == label))
            if hull is None:
                continue
            region = cells.filled(hull, config.cell / 2)
            if region.sum() * config.cell**2 < config.area:
                continue
            edge = region & ~ndimage.binary_erosion(region, around, 2)
            judged = edge & cells.in_view
            inner = ndimage.binary_erosion(region, around, 3)
            if judged.sum() < config.shown * edge.sum() or not inner.any():
                continue
            rim = float(np.median(cells.tops[edge & band]))
            even = ndimage.binary_dilation(np.abs(cells.tops - rim) <= config.uneven, around)
            complete = float(even[judged].mean())
            hollow = float((cells.tops[inner] < rim - config.band).mean())
            if complete >= config.complete and hollow >= config.hollow:
                yield complete, rim, hull


def _bin(cells: _Plan, ring: NDArray[np.float64], rim: float, config: BinsConfig) -> Bin | None:
    ndimage = import_library("scipy.ndimage")
    region = cells.filled(ring, -config.cell)
    low = region & (np.abs(cells.tops) < config.low)
    if low.sum() * config.cell**2 < config.seen:
        return None
    # Walls that lean outwards are seen beyond the floor; what is hidden may be floor.
    floor = ndimage.binary_opening(region & (cells.tops < config.low), np.ones((3, 3)))
    inside = cells.hull(floor)
    if inside is None:
        return None
    outside = ring + np.array([0.0, 0.0, -2 * config.cell])
    return Bin(inside, outside, float(np.median(cells.tops[low])), rim)
