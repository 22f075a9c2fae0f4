"""Low platforms on the table, on which things lie: cutting boards, mats, the plates of turntables.

In cells of the table's plan, what is highest in each shows one as a level region with a convex
outline, a little above the table that lies around it. What rises from it lies on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import PlatformsConfig
from brrp_cli.dependencies import import_library
from brrp_cli.hulls import convex_hull, in_hull
from brrp_cli.segmentation.outlines import rectangle
from brrp_cli.segmentation.plan_cells import AROUND, Cells, PlanCells


@dataclass(frozen=True)
class Platform:
    """A platform on the table.

    outside : hull (m, 3) a cell's width around it, as `Table.hull`, in its plan; height : metres of
    its upper face above the table's plane
    """

    outside: NDArray[np.float64]
    height: float

    def holds(self, plan: NDArray[np.floating]) -> NDArray[np.bool_]:
        """(n,) whether plan points (n, 2) lie over it or its edge."""
        return in_hull(self.outside, plan, 0.0)


def find_platforms(cells: PlanCells, config: PlatformsConfig) -> tuple[Platform, ...]:
    """The platforms that cells show, the largest first."""
    found: list[Platform] = []
    taken = np.zeros_like(cells.tops, bool)
    for region, platform in sorted(_all(cells, config), key=lambda pair: -int(pair[0].sum())):
        if not (region & taken).any():
            taken |= region
            found.append(platform)
    return tuple(found)


def on_platforms(cells: PlanCells, platforms: Sequence[Platform]) -> PlanCells:
    """The cells, of which those on platforms tell how high what is highest lies above these."""
    tops = cells.tops.copy()
    for each in platforms:
        tops[cells.filled(each.outside, 0.0)] -= each.height
    return replace(cells, tops=tops)


def _all(cells: PlanCells, config: PlatformsConfig) -> Iterator[tuple[Cells, Platform]]:
    """What may be platforms, at all heights, with their cells."""
    for height in np.arange(config.least_height, config.most_height, config.step):
        pieces = _level_pieces(cells, height, config)
        while pieces and pieces[0].sum() * cells.cell**2 >= config.piece * config.area:
            level, *pieces = pieces
            hull = _outline(cells, level, config)
            if hull is None:
                continue
            apart = []
            # Things that lie across it part it.
            for piece in pieces:
                joined = _outline(cells, level | piece, config)
                if joined is None:
                    apart.append(piece)
                else:
                    level, hull = level | piece, joined
            pieces = apart
            hull = _with_hidden_corners(cells, level, hull, config)
            region = cells.filled(hull, cells.cell / 2)
            top = float(np.median(cells.tops[level]))
            if _is_one(cells, region, top, config):
                yield region, Platform(hull - np.array([0.0, 0.0, config.around]), top)


def _level_pieces(cells: PlanCells, height: float, config: PlatformsConfig) -> list[Cells]:
    """Cells of about one height, by the pieces that hang together, the largest first."""
    ndimage = import_library("scipy.ndimage")
    # Of a thin platform, the table is no farther off than what is uneven.
    least, most = height - min(config.band, height / 2), height + config.band
    band = (cells.tops >= least) & (cells.tops <= most)
    if band.sum() * cells.cell**2 < config.shown * config.area:
        return []
    # Without what is a cell or two wide, as bled edges are.
    band = ndimage.binary_opening(band, AROUND)
    labels, count = ndimage.label(ndimage.binary_dilation(band, AROUND, config.gap), AROUND)
    pieces = [band & (labels == label) for label in range(1, count + 1)]
    return sorted(pieces, key=lambda piece: -int(piece.sum()))


def _outline(cells: PlanCells, level: Cells, config: PlatformsConfig) -> NDArray[np.float64] | None:
    """The hull (m, 3) of cells `level`, if these are most of what is seen in it but for things that
    lie there."""
    hull = cells.hull(level)
    return hull if hull is not None and _fits(cells, level, hull, config) else None


def _fits(
    cells: PlanCells, level: Cells, hull: NDArray[np.float64], config: PlatformsConfig
) -> bool:
    ndimage = import_library("scipy.ndimage")
    region = cells.filled(hull, cells.cell / 2)
    if level.sum() < config.shown * region.sum():
        return False
    top = float(np.median(cells.tops[level]))
    lower = np.isfinite(cells.tops) & (cells.tops < top - min(config.band, top / 2))
    below = ndimage.binary_erosion(region, AROUND) & lower
    # Waves of a far table have as many cells a little above any level as they have on it.
    above = region & (cells.tops > top + config.band) & (cells.tops < top + config.lies)
    return bool(
        below.sum() <= config.below * region.sum() and above.sum() <= config.uneven * level.sum()
    )


def _with_hidden_corners(
    cells: PlanCells, level: Cells, hull: NDArray[np.float64], config: PlatformsConfig
) -> NDArray[np.float64]:
    """The hull (m, 3), or the rectangle around it, whose corners things may hide."""
    corners = rectangle(cells.middles[level.ravel()], config.rectangle)
    around = None if corners is None else convex_hull(corners)
    return hull if around is None or not _fits(cells, level, around, config) else around


def _is_one(cells: PlanCells, region: Cells, top: float, config: PlatformsConfig) -> bool:
    """Whether a level region, `top` metres high, is large, something lies on it, and the table lies
    around it; a tray has walls there."""
    ndimage = import_library("scipy.ndimage")
    high, seen = cells.tops > top + config.lies, np.isfinite(cells.tops)
    inside = ndimage.binary_erosion(region, AROUND, 2)
    near, beyond = (ndimage.binary_dilation(region, AROUND, out) for out in (1, 3))
    edge = ndimage.binary_dilation(near, AROUND) & ~inside
    ring = beyond & ~near
    judged = ring & seen & ~high
    return bool(
        top >= config.least_height
        and region.sum() * cells.cell**2 >= config.area
        and (inside & high).sum() * cells.cell**2 >= config.filled
        and not _is_walled(cells, edge & seen, high, config)
        and judged.sum() >= config.ring * ring.sum()
        and (judged & (cells.tops < top / 2)).sum() >= config.table * judged.sum()
    )


def _is_walled(cells: PlanCells, edge: Cells, high: Cells, config: PlatformsConfig) -> bool:
    """Whether an edge rises on most sides, as that of a tray does: things lie over it on a few."""
    if not edge.any():
        return False
    middles = cells.middles.reshape(*edge.shape, 2)[edge]
    x, y = (middles - middles.mean(axis=0)).T
    side = (
        np.floor((np.arctan2(y, x) / (2 * np.pi) + 0.5) * config.sides).astype(int) % config.sides
    )
    seen = np.bincount(side, minlength=config.sides)
    rises = np.bincount(side[high[edge]], minlength=config.sides) > config.rises * seen
    return bool(rises.sum() >= config.walled * (seen > 0).sum())
