"""One object is one piece: which parts of a level set belong to it, and how they hang together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import grid_nodes

Region = NDArray[np.bool_]
Nodes = NDArray[np.int64]

# What no route may cross.
CLOSED = -1.0


def one_piece(
    volume: NDArray[np.floating],
    level: float,
    observed: NDArray[np.floating],
    spacing: float,
    config: SurfaceConfig,
) -> Region:
    """Nodes (nx, ny, nz) of one object: those of `volume` at `level` or above that belong to it, in
    one piece, and without cavities that nobody can see into. None is True where nothing is left.

    observed : (n, 3) points of the object, in nodes; spacing : metres between nodes

    Of the connected parts of the level set the one with the greatest volume is kept, of those that
    own a share `config.seen_share` of the observed points (those that they are nearest to, within
    `config.keep_distance`), or of all where none does. Others that own as much, or that own a tenth
    of it and have a share `config.volume_share` of the kept part's volume, are joined to it along
    the most probable way. What is left was seen by few points or none: it is dropped.
    """
    from skimage.measure import label

    occupied = volume >= level
    # Nodes that touch along an edge or at a corner are two pieces to marching cubes.
    parts = label(occupied, connectivity=1)
    sizes = np.bincount(parts.ravel()).astype(np.float64)
    sizes[0] = 0
    seen = _seen_of(parts, observed, config.keep_distance / spacing, len(sizes))
    if not seen.any():
        return np.zeros_like(occupied)
    shares = seen / seen.sum()
    certain = shares >= min(config.seen_share, float(shares.max()))
    largest = int(np.argmax(np.where(certain, sizes, 0)))
    bulky = sizes >= config.volume_share * sizes[largest]
    kept = certain | (bulky & (shares >= config.seen_share / 10))
    piece = parts == largest
    others = [int(number) for number in np.flatnonzero(kept) if number != largest]
    if others:
        piece = _joined(piece, parts, others, volume / level, spacing, config)
    return _without_cavities(piece)


def near_observed(occupied: Region, observed: NDArray[np.floating], farthest: float) -> Region:
    """The connected parts of `occupied` (nx, ny, nz) that come within `farthest` nodes of an
    observed point (n, 3), in nodes."""
    from scipy.ndimage import distance_transform_edt
    from skimage.measure import label

    cells = np.rint(observed).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < occupied.shape)).all(axis=1)]
    if not len(cells):
        return np.zeros_like(occupied)
    far = np.ones(occupied.shape, dtype=bool)
    far[tuple(cells.T)] = False
    near = distance_transform_edt(far) <= farthest
    parts = label(occupied, connectivity=3)
    return np.asarray(np.isin(parts, np.unique(parts[near & occupied])) & occupied)


def _seen_of(
    parts: NDArray[np.integer], observed: NDArray[np.floating], farthest: float, count: int
) -> NDArray[np.int64]:
    """How many of the observed points (n, 3), in nodes, each of `count` parts is nearest to, and
    nearer than `farthest`."""
    from scipy.ndimage import binary_erosion
    from scipy.spatial import cKDTree

    cells = np.rint(observed).astype(np.int64)
    cells = np.clip(cells, 0, np.array(parts.shape) - 1)
    outside = np.abs(observed - cells).max(axis=1, initial=0) > farthest
    own = parts[tuple(cells.T)]
    own[outside] = 0
    lone = (own == 0) & ~outside
    border = np.argwhere((parts > 0) & ~binary_erosion(parts > 0))
    if lone.any() and len(border):
        distance, row = cKDTree(border).query(observed[lone], distance_upper_bound=farthest)
        near = np.isfinite(distance)
        found = np.zeros(len(row), own.dtype)
        found[near] = parts[tuple(border[row[near]].T)]
        own[lone] = found
    seen = np.bincount(own, minlength=count)
    seen[0] = 0
    return seen


def _joined(
    piece: Region,
    parts: NDArray[np.integer],
    others: list[int],
    share: NDArray[np.floating],
    spacing: float,
    config: SurfaceConfig,
) -> Region:
    """`piece` and the parts `others`, each with the way to it along which the sum of negative log
    probabilities, `share` of the level's, is least. The nearest, in that sense, comes first, and
    the next may join it there."""
    radius = max(1.0, config.route_radius / spacing)
    wanted = np.isin(parts, others)
    window = _window(piece | wanted, margin=config.route_margin)
    piece_in, parts_in, wanted = piece[window].copy(), parts[window], wanted[window]
    cost = config.route_step - np.log(np.clip(share[window], config.route_least, 1.0))
    while wanted.any():
        way = _cheapest_way(cost, piece_in, wanted, config.route_nodes)
        reached = parts_in == parts_in[tuple(way[-1])]
        piece_in |= reached | _thick(way, piece_in.shape, radius)
        wanted &= ~reached
    result = piece.copy()
    result[window] = piece_in
    return result


def _cheapest_way(cost: NDArray[np.floating], start: Region, end: Region, most: int) -> Nodes:
    """Nodes (n, 3) of the cheapest way from one region to another.

    On a grid of more than `most` nodes it is first looked for on one of half the nodes along each
    axis, and then near that way: on the whole grid, a search takes half a second.
    """
    if cost.size > most:
        padded = [(0, n % 2) for n in cost.shape]
        coarse = _halved(np.pad(cost, padded, mode="edge"), np.min)
        regions = [_halved(np.pad(region, padded), np.max) for region in (start, end)]
        rough = _thick(_way(coarse, *regions), coarse.shape, 1.8)
        near = rough.repeat(2, 0).repeat(2, 1).repeat(2, 2)[tuple(map(slice, cost.shape))]
        cost = np.where(near, cost, CLOSED)
        start, end = start & near, end & near
    return _way(cost, start, end)


def _way(cost: NDArray[np.floating], start: Region, end: Region) -> Nodes:
    """As _cheapest_way, by Dijkstra's algorithm; a region may overlap the other."""
    from skimage.graph import MCP_Geometric

    both = np.argwhere(start & end)
    if len(both):
        return both[:1]
    ends = np.argwhere(_border(end))
    ways = MCP_Geometric(np.where(start & ~_border(start), CLOSED, cost))
    costs, _ = ways.find_costs(
        np.argwhere(_border(start)).tolist(), ends.tolist(), find_all_ends=False
    )
    return np.array(ways.traceback(ends[np.argmin(costs[tuple(ends.T)])]))


def _halved(values: NDArray[Any], of: Callable[..., NDArray[Any]]) -> NDArray[Any]:
    """Of each 2 x 2 x 2 values of an array with even sides, the one that `of` takes."""
    x, y, z = (n // 2 for n in values.shape)
    return of(values.reshape(x, 2, y, 2, z, 2), axis=(1, 3, 5))


def _window(region: Region, margin: int) -> tuple[slice, slice, slice]:
    """The box around a region, `margin` nodes wider."""
    found = []
    for axis in range(3):
        there = np.flatnonzero(region.any(axis=tuple(a for a in range(3) if a != axis)))
        found.append(slice(max(0, int(there[0]) - margin), int(there[-1]) + margin + 1))
    return found[0], found[1], found[2]


def _border(region: Region) -> Region:
    """Nodes of a region with a neighbour that is not."""
    from scipy.ndimage import binary_erosion

    return np.asarray(region & ~binary_erosion(region))


def _thick(way: Nodes, shape: tuple[int, ...], radius: float) -> Region:
    """Nodes within `radius` >= 1 nodes of those of a way (n, 3): connected along the axes, although
    a way may step along a diagonal."""
    reach = int(radius)
    steps = grid_nodes([np.arange(-reach, reach + 1)] * 3)
    ball = steps.reshape(-1, 3)
    ball = ball[(ball**2).sum(axis=1) <= radius**2]
    nodes = (way[:, None] + ball).reshape(-1, 3)
    nodes = nodes[((nodes >= 0) & (nodes < shape)).all(axis=1)]
    region = np.zeros(shape, bool)
    region[tuple(nodes.T)] = True
    return region


def _without_cavities(piece: Region) -> Region:
    """A piece with what cannot be reached from outside of it along the axes."""
    from skimage.measure import label

    outside = label(np.pad(~piece, 1, constant_values=True), connectivity=1)
    return np.asarray(outside != outside[0, 0, 0])[1:-1, 1:-1, 1:-1]
