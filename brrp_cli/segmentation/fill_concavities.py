"""The inside of hollow objects: a bowl's floor lies as low as the table."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import ConcavitiesConfig
from brrp_cli.dependencies import import_library
from brrp_cli.hulls import convex_hull, in_hull


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
    ndimage = import_library("scipy.ndimage")
    filled = segmap.copy()
    cell = config.cell
    for object_id, window in enumerate(ndimage.find_objects(segmap), start=1):
        if window is None:
            continue
        # What lies inside the hull of the mask lies inside the box around it.
        mask, near = segmap[window] == object_id, plan[window]
        walls = near[mask]
        hull = convex_hull(walls)
        if hull is None:
            continue
        rows, columns = np.nonzero(candidates[window] & (segmap[window] == 0))
        inside = in_hull(hull, near[rows, columns], -config.wall)
        rows, columns = rows[inside], columns[inside]
        outline = convex_hull(_outer(mask))
        if outline is not None:
            inside = in_hull(outline, np.stack([rows, columns], axis=-1), 0.0)
            rows, columns = rows[inside], columns[inside]
        if len(rows) == 0:
            continue
        corner = np.floor(walls.min(axis=0) / cell).astype(np.int64)
        cells, member = _cells(near[rows, columns], cell, corner)
        walls = (_cells(walls, cell, corner)[0] + 0.5) * cell
        around = _sectors_seen((cells + 0.5) * cell, walls, config.sectors) >= config.around
        chosen = around[member]
        filled[window][rows[chosen], columns[chosen]] = object_id
    return filled


def _outer(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(m, 2) the first and the last pixel of each row: their hull is the mask's."""
    rows = np.flatnonzero(mask.any(axis=1))
    first = mask[rows].argmax(axis=1)
    last = mask.shape[1] - 1 - mask[rows, ::-1].argmax(axis=1)
    return np.stack([np.tile(rows, 2), np.concatenate([first, last])], axis=-1).astype(np.float64)


def _cells(
    plan: NDArray[np.float64], cell: float, corner: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The cells (m, 2) that plan points (n, 2), none beyond `corner`, lie in, and which of them
    each does (n,)."""
    cells = np.floor(plan / cell).astype(np.int64) - corner
    width = int(cells[:, 1].max()) + 1
    codes, member = np.unique(cells[:, 0] * width + cells[:, 1], return_inverse=True)
    return np.stack([codes // width, codes % width], axis=-1) + corner, member.reshape(-1)


def _sectors_seen(
    centres: NDArray[np.floating], walls: NDArray[np.floating], sectors: int
) -> NDArray[np.int64]:
    """(n,) in how many sectors around each of the plan points (n, 2) wall points (m, 2) lie."""
    seen = np.zeros((len(centres), sectors), dtype=bool)
    for row, centre in zip(seen, centres, strict=True):
        offset = walls - centre
        angle = np.arctan2(offset[:, 1], offset[:, 0]) % (2 * np.pi)
        row[(angle * sectors / (2 * np.pi)).astype(np.int64) % sectors] = True
    return seen.sum(axis=1)
