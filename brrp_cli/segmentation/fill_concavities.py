"""The inside of hollow objects: a bowl's floor lies as low as the table."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import ConcavitiesConfig
from brrp_cli.segmentation.table_plane import convex_hull, in_hull


def fill_inside(
    segmap: NDArray[np.int64],
    plan: NDArray[np.float64],
    candidates: NDArray[np.bool_],
    config: ConcavitiesConfig,
) -> NDArray[np.int64]:
    """Masks (H, W) in which each object also holds what its walls stand around.

    A candidate pixel (H, W) bool that is background joins an object if it lies inside the convex
    hull of the object's mask and inside that of its footprint, and sees the object's points in
    two thirds of all directions in the plan; the table seen in the crook of a bent object sees
    them in half at most.
    plan : (H, W, 2) plan coordinates, metres.
    """
    filled = segmap.copy()
    free = candidates & (segmap == 0)
    cell = config.cell
    for object_id in np.unique(segmap[segmap > 0]):
        walls = plan[segmap == object_id]
        hull = convex_hull(walls)
        if hull is None:
            continue
        low, high = walls.min(axis=0), walls.max(axis=0)
        box = free & (plan >= low).all(axis=-1) & (plan <= high).all(axis=-1)
        rows, columns = np.nonzero(box)
        outline = convex_hull(np.argwhere(segmap == object_id).astype(np.float64))
        inside = in_hull(hull, plan[rows, columns], -config.wall)
        if outline is not None:
            inside &= in_hull(outline, np.stack([rows, columns], axis=-1), 0.0)
        rows, columns = rows[inside], columns[inside]
        if len(rows) == 0:
            continue
        cells, member = np.unique(np.floor(plan[rows, columns] / cell), axis=0, return_inverse=True)
        walls = (np.unique(np.floor(walls / cell), axis=0) + 0.5) * cell
        around = _sectors_seen((cells + 0.5) * cell, walls, config.sectors) >= config.around
        chosen = around[member.reshape(-1)]
        filled[rows[chosen], columns[chosen]] = object_id
    return filled


def _sectors_seen(
    centres: NDArray[np.float64], walls: NDArray[np.float64], sectors: int
) -> NDArray[np.int64]:
    """(n,) in how many sectors around each of the plan points (n, 2) wall points (m, 2) lie."""
    seen = np.zeros((len(centres), sectors), dtype=bool)
    for row, centre in zip(seen, centres, strict=True):
        offset = walls - centre
        angle = np.arctan2(offset[:, 1], offset[:, 0]) % (2 * np.pi)
        row[(angle * sectors / (2 * np.pi)).astype(np.int64) % sectors] = True
    return seen.sum(axis=1)
