"""Fragments of objects in the image, and which of them are one object."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.frames.table import convex_hull, in_hull

_EROSION = 2  # pixels; wider bridges between fragments hold
_MIN_CORE = 30  # pixels
_CELL = 0.003


def flying_pixels(
    depth: NDArray[np.floating], K: NDArray[np.float64], max_slope: float
) -> NDArray[np.bool_]:
    """(H, W) pixels on a depth edge: the step to a neighbour is steeper than a seen surface.

    depth : (H, W) metres, NaN = no return. The slope is depth over width, `max_slope` at most.
    """
    flying = np.zeros(depth.shape, dtype=bool)
    for axis, focal in ((0, K[1, 1]), (1, K[0, 0])):
        near = np.moveaxis(depth, axis, 0)
        marked = np.moveaxis(flying, axis, 0)
        with np.errstate(invalid="ignore"):
            width = np.minimum(near[1:], near[:-1]) / focal
            steep = np.abs(near[1:] - near[:-1]) > max_slope * width
        marked[1:] |= steep
        marked[:-1] |= steep
    return flying


def find_fragments(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Labels (H, W) of the mask's parts, 1, 2, ...: connected, and still so without thin bridges.

    Pixels of the mask that hang on no part are 0.
    """
    ndimage = import_library("scipy.ndimage")
    core, _ = ndimage.label(ndimage.binary_erosion(mask, iterations=_EROSION, border_value=1))
    small = np.bincount(core.ravel()) < _MIN_CORE
    core[small[core]] = 0
    if not core.any():
        return np.zeros(mask.shape, np.int64)
    rows, columns = ndimage.distance_transform_edt(
        core == 0, return_distances=False, return_indices=True
    )
    whole, _ = ndimage.label(mask, structure=np.ones((3, 3)))
    same = whole == whole[rows, columns]
    return np.where(mask & same, core[rows, columns], 0).astype(np.int64)


def grow(
    labels: NDArray[np.int64],
    points: NDArray[np.floating],
    candidates: NDArray[np.bool_],
    reach: float,
) -> NDArray[np.int64]:
    """Labels (H, W) after each unlabelled candidate took the label of the nearest labelled point.

    points : (H, W, 3) metres; no point is nearer than `reach`: the candidate stays 0.
    """
    spatial = import_library("scipy.spatial")
    free = candidates & (labels == 0)
    if not labels.any() or not free.any():
        return labels
    _, nearest = spatial.cKDTree(points[labels > 0]).query(points[free], distance_upper_bound=reach)
    grown = labels.copy()
    grown[free] = np.append(labels[labels > 0], 0)[nearest]
    return grown


def merge_by_footprint(
    labels: NDArray[np.int64], plan: NDArray[np.float64], overlap: float
) -> NDArray[np.int64]:
    """Labels (H, W) in which fragments that stand on the same spot have one label.

    Things that stand side by side have footprints apart; the outer and the inner wall of a mug,
    or what a depth edge cut in two, have not. plan : (H, W, 2) plan coordinates. Two fragments
    are merged if the convex hulls of their footprints share `overlap` of the smaller hull.
    """
    csgraph = import_library("scipy.sparse.csgraph")
    ids = [int(i) for i in np.unique(labels) if i]
    footprints = [_footprint(plan[labels == i]) for i in ids]
    same = np.eye(len(ids), dtype=bool)
    for i, first in enumerate(footprints):
        for j, second in enumerate(footprints[:i]):
            shared = len(first & second)
            same[i, j] = shared > 0 and shared >= overlap * min(len(first), len(second))
    _, group = csgraph.connected_components(same, directed=False)
    table = np.zeros(labels.max() + 1, dtype=np.int64)
    table[ids] = group + 1
    return table[labels]


def _footprint(plan: NDArray[np.float64]) -> set[tuple[int, int]]:
    """Cells of the plan grid inside the convex hull of plan points (n, 2)."""
    cells = np.unique(np.floor(plan / _CELL).astype(np.int64), axis=0)
    hull = convex_hull(cells.astype(np.float64))
    if hull is not None:
        low, high = cells.min(axis=0), cells.max(axis=0)
        box = np.stack(
            np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True))), axis=-1
        ).reshape(-1, 2)
        cells = box[in_hull(hull, box.astype(np.float64), 1e-9)]
    return {(int(a), int(b)) for a, b in cells}
