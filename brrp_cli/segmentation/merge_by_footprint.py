"""Parts of the image that stand on one spot of the table: the inside of a mug and its outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import FootprintsConfig, SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.segmentation.components import contacts, relabel
from brrp_cli.segmentation.merge_by_colour import same_hue, vivid_hues
from brrp_cli.segmentation.table_plane import convex_hull, in_hull

Array = NDArray[np.floating]

# No table has so many cells from its middle to its edge.
_HALF = 2**24


@dataclass(frozen=True)
class Standing:
    """One part as it stands.

    cells : (n,) of the plan, in the hull of its footprint, as `_codes`, ascending; box : the lowest
    and highest of them, (2,) each;
    middle : theirs, metres; plan, normals : (n, 2) its points and their normals in the plan;
    low, high : heights between which nine tenths of it lie, metres
    """

    cells: NDArray[np.int64]
    box: tuple[NDArray[np.int64], NDArray[np.int64]]
    middle: Array
    plan: Array
    normals: Array
    low: float
    high: float


def join_on_one_spot(
    parts: NDArray[np.int64],
    plan: Array,
    height: Array,
    plan_normals: Array,
    crease: Array,
    rgb: NDArray[np.uint8],
    config: SegmentConfig,
) -> NDArray[np.int64]:
    """Labels (H, W) in which parts that belong together, though something lies between them in the
    image, have one label.

    Parts that meet in a hollow crease are two things, unless the upper one neither stands on the
    table nor lies over the lower one: a handle, the body of a drill. Of parts that do not, whose
    footprints share `config.overlap` of the smaller one, one may be the inside of the other: it
    faces the other's middle, as the far wall of a mug does. Or both are pieces of one thing, at one
    height. Parts of one vivid colour that share some of their footprints are one thing however they
    meet: the studs of a brick.

    plan : (H, W, 2) plan coordinates, height : (H, W) above the table, metres; plan_normals :
    (H, W, 2) the normals' part in the plan; crease : (H, W) hollow creases that are no jumps of
    depth, 0 to 1; rgb : (H, W, 3)
    """
    own = config.footprints
    count = int(parts.max()) + 1
    ndimage = import_library("scipy.ndimage")
    standing = {
        i: _standing(
            parts[window] == i, plan[window], height[window], plan_normals[window], own.cell
        )
        for i, window in enumerate(ndimage.find_objects(parts), start=1)
        if window is not None
    }
    touch = contacts(parts, crease, config.components)
    hues = vivid_hues(parts, rgb, config.vivid_colour)
    same = np.zeros((count, count), dtype=bool)
    for i, first in standing.items():
        for j, second in standing.items():
            if j >= i:
                continue
            if _apart(first, second):
                continue
            both = np.intersect1d(first.cells, second.cells, assume_unique=True)
            shared = len(both) / min(len(first.cells), len(second.cells))
            if touch[i, j]:
                pieces = shared > own.over and _hangs(first, second, own)
            else:
                pieces = shared > own.pieces and _at_one_height(first, second, own)
            inward = max(_inward(first, second, own), _inward(second, first, own))
            inside = inward > own.inward and shared > config.overlap
            coloured = shared > own.coloured and same_hue(hues[i], hues[j], config.vivid_colour)
            walls = _walls(first, second, own) or _walls(second, first, own)
            same[i, j] = pieces or inside or coloured or walls
    return relabel(parts, same)


def _standing(
    mask: NDArray[np.bool_], plan: Array, height: Array, normals: Array, cell: float
) -> Standing:
    cells = _filled(_places(np.unique(_codes(np.floor(plan[mask] / cell).astype(np.int64)))))
    bottom, top = np.percentile(height[mask], (5, 95))
    known = mask & np.isfinite(normals[..., 0])
    return Standing(
        cells=np.sort(_codes(cells)),
        box=(cells.min(axis=0), cells.max(axis=0)),
        middle=(cells.mean(axis=0) + 0.5) * cell,
        plan=plan[known],
        normals=normals[known],
        low=float(bottom),
        high=float(top),
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


def _hangs(first: Standing, second: Standing, config: FootprintsConfig) -> bool:
    """Whether the upper of two that touch neither stands on the table nor lies on the lower."""
    lower, upper = (first, second) if first.low < second.low else (second, first)
    middle = _codes(np.floor(upper.middle / config.cell).astype(np.int64))
    return upper.low > config.stands and not np.isin(middle, lower.cells)


def _at_one_height(first: Standing, second: Standing, config: FootprintsConfig) -> bool:
    shared = min(first.high, second.high) - max(first.low, second.low)
    return shared > config.same_range * min(first.high - first.low, second.high - second.low)
