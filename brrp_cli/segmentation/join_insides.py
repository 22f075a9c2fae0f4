"""The inside of a mug and its outside, which stand on one spot of the table, are one thing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import FootprintsConfig
from brrp_cli.dependencies import import_library
from brrp_cli.geometry import within
from brrp_cli.hulls import convex_hull, in_hull
from brrp_cli.segmentation.components import relabel

Array = NDArray[np.floating]

# No table has so many cells from its middle to its edge.
_HALF = 2**24


@dataclass(frozen=True)
class Standing:
    """One part as it stands.

    cells : (n,) of the plan, in the hull of its footprint, as `_codes`, ascending; box : the lowest
    and highest of them, (2,) each; plan, normals : (n, 2) its points and their normals in the plan;
    high : metres below which nineteen twentieths of it lie
    """

    cells: NDArray[np.int64]
    box: tuple[NDArray[np.int64], NDArray[np.int64]]
    plan: Array
    normals: Array
    high: float


def join_insides(
    parts: NDArray[np.int64],
    plan: Array,
    height: Array,
    plan_normals: Array,
    config: FootprintsConfig,
) -> NDArray[np.int64]:
    """Labels (H, W) in which the inside of a hollow thing, as is seen from above, has its outside's
    label: it faces the middle of both, as the far wall of a mug does, and lies over the outside's
    footprint, or is round with it.

    plan : (H, W, 2) plan coordinates, height : (H, W) above the table, metres; plan_normals :
    (H, W, 2) the normals' part in the plan
    """
    count = int(parts.max()) + 1
    ndimage = import_library("scipy.ndimage")
    standing = {
        i: _standing(parts[window] == i, plan[window], height[window], plan_normals[window], config)
        for i, window in enumerate(ndimage.find_objects(parts), start=1)
        if window is not None
    }
    same = np.zeros((count, count), dtype=bool)
    for i, first in standing.items():
        for j, second in standing.items():
            if j >= i or _apart(first, second):
                continue
            both = np.intersect1d(first.cells, second.cells, assume_unique=True)
            shared = len(both) / min(len(first.cells), len(second.cells))
            inward = max(_inward(first, second, config), _inward(second, first, config))
            inside = inward > config.inward and shared > config.overlap
            walls = _walls(first, second, config) or _walls(second, first, config)
            same[i, j] = inside or walls
    return relabel(parts, same)


def _standing(
    mask: NDArray[np.bool_], plan: Array, height: Array, normals: Array, config: FootprintsConfig
) -> Standing:
    # Bled pixels lie far behind, and would be most of the hull.
    low, high = np.percentile(plan[mask], (config.bled, 100 - config.bled), axis=0)
    points = plan[mask]
    most = within(points, low, high)
    points = points[most] if most.any() else points
    cells = _filled(_places(np.unique(_codes(np.floor(points / config.cell).astype(np.int64)))))
    known = mask & np.isfinite(normals[..., 0])
    return Standing(
        cells=np.sort(_codes(cells)),
        box=(cells.min(axis=0), cells.max(axis=0)),
        plan=plan[known],
        normals=normals[known],
        high=float(np.percentile(height[mask], config.highest)),
    )


def _codes(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """One number (...) for each cell (..., 2)."""
    return np.asarray((cells[..., 0] + _HALF) * (2 * _HALF) + cells[..., 1] + _HALF)


def _places(codes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The cells (n, 2) of codes (n,)."""
    return np.stack([codes // (2 * _HALF), codes % (2 * _HALF)], axis=-1) - _HALF


def _filled(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """All cells (m, 2) in the convex hull of cells (n, 2)."""
    hull = convex_hull(cells.astype(np.float64))
    if hull is None:
        return cells
    low, high = cells.min(axis=0), cells.max(axis=0)
    box = np.stack(
        np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True))), axis=-1
    ).reshape(-1, 2)
    return box[in_hull(hull, box.astype(np.float64), 1e-9)]


def _apart(first: Standing, second: Standing) -> bool:
    """Whether table lies between two footprints, as their bounding boxes tell."""
    return bool(
        (first.box[0] > second.box[1] + 2).any() or (second.box[0] > first.box[1] + 2).any()
    )


def _gap(first: Standing, second: Standing) -> float:
    """What the hull of both footprints holds beside them, as a part of them."""
    both = np.union1d(first.cells, second.cells)
    return len(_filled(_places(both))) / len(both) - 1.0


def _inward(inner: Standing, outer: Standing, config: FootprintsConfig) -> float:
    """How much the steep surface of `inner` faces the middle of both: 1 all of it, -1 away. 0 where
    it rises above `outer`."""
    if inner.high > outer.high + config.above:
        return 0.0
    both = _places(np.union1d(inner.cells, outer.cells))
    toward = (both.mean(axis=0) + 0.5) * config.cell - inner.plan
    length = np.linalg.norm(toward, axis=-1, keepdims=True)
    facing = np.sum(toward * inner.normals, axis=-1) / np.maximum(length[:, 0], 1e-9)
    # A floor faces neither way, and counts neither way.
    steepness = np.linalg.norm(inner.normals, axis=-1).sum()
    return float(facing.sum() / max(steepness, 1e-9))


def _walls(far: Standing, near: Standing, config: FootprintsConfig) -> bool:
    """Whether two are the far wall of a round thing, seen from within, and its near wall, seen from
    without: of one height, one facing the middle and one away, and round together."""
    return (
        abs(far.high - near.high) < config.above
        and _inward(far, near, config) > config.facing
        and _inward(near, far, config) < -config.facing
        and _gap(far, near) < config.round
    )
