"""What is seen of a surface of revolution, as if it were seen from all around.

Turned about its axis, such a thing looks as it did: what one side of it shows holds for every side.
The back of a pot is as far from the axis as its front, and the wall of a bowl lies between its
outer side, seen in front, and its inner side, seen behind. So what is known is brought together in
a half plane, of distances from the axis and heights along it: where the surface lies, which rings
about the axis are free, and what the network thinks of the others on average.

What stands out of the rings, such as a handle, is left to the network.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, uniform_filter
from scipy.spatial import cKDTree

from brrp_cli.completion.revolution_axis import Axis
from brrp_cli.completion.roundness import mean_normals, sides
from brrp_cli.completion.seen_surface import Bounds, joined, ramp_bounds
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.config import MeanConfig, RevolutionConfig

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


def round_logits(
    axis: Axis,
    nodes: Array,
    empty: Bools,
    guess: NDArray[np.floating],
    part: VisiblePart,
    shell: float,
    config: MeanConfig,
) -> NDArray[np.float32]:
    """Logits (nx, ny, nz) at nodes (nx, ny, nz, 3), metres, camera frame, of an object that is
    round about the axis; those of `guess` where it is empty.

    empty : (nx, ny, nz); guess : the network's logits, anything where it is empty; shell : metres,
    how thick what was seen is
    """
    own, limit = config.revolution, config.limit
    cell = own.cell * float(np.linalg.norm(nodes[1, 0, 0] - nodes[0, 0, 0]))
    flat = axis.half_plane(nodes.reshape(-1, 3))
    rings = _Rings(float(flat[:, 0].min()), cell, flat)
    left = ~empty.ravel()
    # Under the plane there is nothing, however the ring goes on above it.
    above = np.ones(len(left), bool)
    if part.plane is not None:
        above = part.plane.signed_distance(nodes.reshape(-1, 3)) > 0
    free = rings.mean(empty.ravel()[above].astype(np.float64), above) > own.free
    thought = np.clip(guess.ravel()[left], -limit, limit)
    logits = np.where(free, -limit, rings.mean(thought, left))
    ring = rings.at(axis.half_plane(part.seen), free.astype(np.float64))
    out = (ring > 0.5) & _one_sided(axis, part.seen, own)
    bounds = _seen_bounds(axis, flat[left], part.seen[~out], part.normals[~out], shell, config)
    turned = bounds.applied(rings.at(flat[left], logits))
    more = np.flatnonzero(thought > turned)
    if out.any() and len(more):
        _, nearest = part.tree.query(nodes.reshape(-1, 3)[left][more])
        more = more[out[nearest]]
        turned[more] = thought[more]
    found = guess.astype(np.float32)
    found[~empty] = turned
    return found


def _one_sided(axis: Axis, points: Array, config: RevolutionConfig) -> Bools:
    """Which of seen points (n, 3) have others about them, once they are turned, from nearly the
    same side alone: those of a handle, of which a turn tells nothing."""
    flat = axis.half_plane(points)
    index = np.floor((flat - flat.min(axis=0)) / config.patch).astype(np.int64)
    shape = tuple(index.max(axis=0) + 1)
    ring = np.ravel_multi_index(tuple(index.T), shape)
    away = axis.radii(points)[1] @ axis.sides.T
    about = [
        uniform_filter(
            np.bincount(ring, each, int(np.prod(shape))).reshape(shape), 3, mode="constant"
        )
        for each in (np.ones(len(points)), *away.T)
    ]
    count, *direction = (each.ravel()[ring] for each in about)
    # The length of the mean direction: 1 where all are the same.
    return np.asarray(np.hypot(*direction) > config.one_sided * count)


@dataclass(frozen=True)
class _Rings:
    """Rings about an axis, of `cell` metres, from the height `low` on, that hold points with these
    heights and radii (n, 2)."""

    low: float
    cell: float
    flat: Array

    def mean(self, values: NDArray[np.floating], of: Bools | None = None) -> Array:
        """(heights, radii) of values of the points, or of some `of` (n,) them, over each ring; 0
        where there are none."""
        index = np.rint(self._cells(self.flat)).astype(np.int64)
        shape = tuple(index.max(axis=1) + 1)
        ring = np.ravel_multi_index(tuple(index if of is None else index[:, of]), shape)
        count = np.bincount(ring, minlength=int(np.prod(shape)))
        total = np.bincount(ring, values, minlength=len(count))
        return np.asarray((total / np.maximum(count, 1)).reshape(shape))

    def at(self, flat: Array, values: Array) -> Array:
        """Values (heights, radii) of rings at heights and radii (m, 2), linear between."""
        return np.asarray(map_coordinates(values, self._cells(flat), order=1, mode="nearest"))

    def _cells(self, flat: Array) -> Array:
        return np.stack([flat[:, 0] - self.low, flat[:, 1]]) / self.cell


def _seen_bounds(
    axis: Axis, asked: Array, points: Array, normals: Array, shell: float, config: MeanConfig
) -> Bounds:
    """Of the logits at heights and radii (m, 2), from seen points (n, 3) with normals (n, 3)."""
    own = config.revolution
    nothing = Bounds(np.full(len(asked), -config.limit), np.full(len(asked), config.limit))
    flat, across = axis.half_plane(points), axis.normals_in_half_plane(points, normals)
    reach = float(np.hypot(shell, own.beside))
    found = [nothing]
    for side in sides(across):
        if side.sum() < own.neighbours:
            continue
        tree = cKDTree(flat[side])
        distance, rows = tree.query(asked, k=own.neighbours, distance_upper_bound=reach)
        near = np.isfinite(distance).all(axis=1)
        rows = rows[near]
        normal = mean_normals(across[side], rows)
        behind = ((flat[side][rows].mean(axis=1) - asked[near]) * normal).sum(axis=1)
        beside = np.sqrt(np.maximum(distance[near, 0] ** 2 - behind**2, 0))
        told = beside < own.beside
        ramp = ramp_bounds(behind, told, told, shell, config)
        bounds = Bounds(nothing.least.copy(), nothing.most.copy())
        bounds.least[near], bounds.most[near] = ramp.least, ramp.most
        found.append(bounds)
    return joined(found)
