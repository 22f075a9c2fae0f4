"""Bins, totes and trays on the table: walls of one height around a floor on which objects lie.

In cells of the table's plan, what is highest in each shows their rim as a thin line of one height,
along most of its own convex hull. Things inside, and gaps where depth is missing, do not matter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import BinsConfig
from brrp_cli.dependencies import import_library
from brrp_cli.segmentation.plan_cells import AROUND, Cells, PlanCells
from brrp_cli.segmentation.rectangles import rectangles


@dataclass(frozen=True)
class Bin:
    """A bin on the table; hulls as `Table.hull`, in its plan.

    inside : hull (m, 3) of the floor that is seen; outside : hull (m, 3), `around` metres from the
    rim
    floor, rim : metres of the floor and of the walls' upper end above the table's plane
    """

    inside: NDArray[np.float64]
    outside: NDArray[np.float64]
    around: float
    floor: float
    rim: float


@dataclass(frozen=True)
class _Rim:
    """hull : (m, 3) around it; height : metres; length : cells of it that are there"""

    hull: NDArray[np.float64]
    height: float
    length: int


def find_bins(cells: PlanCells, config: BinsConfig) -> tuple[Bin, ...]:
    """The bins that points on and above the table show, those with the longest rim first."""
    bins: list[Bin] = []
    taken = np.zeros(cells.tops.shape, dtype=bool)
    for rim in sorted(_rings(cells, config), key=lambda rim: -rim.length):
        region = cells.filled(rim.hull, config.cell / 2)
        if (region & taken).any():
            continue
        found = _bin(cells, rim, config)
        if found is not None:
            taken |= region
            bins.append(found)
    return tuple(bins)


def _rings(cells: PlanCells, config: BinsConfig) -> Iterator[_Rim]:
    """What may be rims, at all heights."""
    for height in np.arange(config.least_height, config.most_height, config.step):
        band = np.abs(cells.tops - height) <= config.band
        if band.sum() * config.cell**2 < config.least_rim:
            continue
        for hull, least in (
            *((hull, config.area) for hull in _hulls(cells, band, config)),
            *((hull, config.rectangle) for hull in rectangles(cells.middles[band.ravel()], config)),
        ):
            rim = _rim(cells, band, hull, least, config)
            if rim is not None:
                yield rim


def _hulls(cells: PlanCells, band: Cells, config: BinsConfig) -> Iterator[NDArray[np.float64]]:
    """The hull (m, 3) of each group of cells of one height."""
    ndimage = import_library("scipy.ndimage")
    # Gaps of a few cells are pixels without depth.
    labels, _ = ndimage.label(ndimage.binary_dilation(band, AROUND, config.gap), AROUND)
    for label, box in enumerate(ndimage.find_objects(labels), start=1):
        if np.prod([side.stop - side.start for side in box]) * config.cell**2 < config.area:
            continue
        hull = cells.hull(band & (labels == label))
        if hull is not None:
            yield hull


def _rim(
    cells: PlanCells, band: Cells, hull: NDArray[np.float64], least: float, config: BinsConfig
) -> _Rim | None:
    """The rim along a hull (m, 3), if most of it is there and what it encloses is hollow.

    What rises over it may hide it.
    """
    ndimage = import_library("scipy.ndimage")
    region = cells.filled(hull, config.cell / 2)
    if region.sum() * config.cell**2 < least:
        return None
    edge = region & ~ndimage.binary_erosion(region, AROUND, 2)
    inner = ndimage.binary_erosion(region, AROUND, 3)
    judged = edge & cells.in_view
    if judged.sum() < config.shown * edge.sum() or not inner.any() or not (edge & band).any():
        return None
    # A rectangle around a circle has nothing in its corners.
    corners = cells.hull(edge & band)
    if corners is None or cells.filled(corners, 0.0).sum() < config.corners * region.sum():
        return None
    height = float(np.median(cells.tops[edge & band]))
    even = ndimage.binary_dilation(np.abs(cells.tops - height) <= config.uneven, AROUND)
    hidden = (cells.tops > height + config.uneven) & ~even
    there, open_ = int((judged & even).sum()), int((judged & ~hidden).sum())
    # What rises over the rim may stand on the floor.
    low, level = (
        int((inner & (cells.tops < height + above)).sum()) for above in (-config.band, config.band)
    )
    if (
        there < config.complete * open_
        or there < config.shown * judged.sum()
        or low < config.hollow * max(level, 1)
    ):
        return None
    return _Rim(hull, height, there)


def _bin(cells: PlanCells, rim: _Rim, config: BinsConfig) -> Bin | None:
    """None where nothing lies in it: then it is a thing itself."""
    ndimage = import_library("scipy.ndimage")
    region = cells.filled(rim.hull, -config.cell)
    # Walls that lean outwards are seen beyond the floor; what is hidden may be floor.
    low = cells.tops < config.low
    inside = cells.hull(ndimage.binary_opening(region & low, AROUND))
    held = cells.filled(inside, 0.0) if inside is not None else np.zeros_like(region)
    if inside is None or held.sum() < config.floor_seen * region.sum():
        # A heap hides the floor.
        inside = rim.hull + np.array([0.0, 0.0, config.wall])
        held = cells.filled(inside, 0.0)
    floor = cells.tops[held & (np.abs(cells.tops) < config.low)]
    level = float(np.median(floor)) if len(floor) * config.cell**2 >= config.least_floor else 0.0
    # Not at its sides, where walls may begin.
    lies = ndimage.binary_erosion(held, AROUND, 2) & (cells.tops > level + config.lies)
    if lies.sum() * config.cell**2 < config.filled:
        return None
    around = 2 * config.cell
    outside = rim.hull - np.array([0.0, 0.0, around])
    return Bin(inside, outside, around, level, rim.height)
