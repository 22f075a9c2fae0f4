"""What is seen of a surface of revolution, seen from all around.

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
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from brrp_cli.completion.revolution_axis import Axis, free_axis, upright_axis
from brrp_cli.completion.seen_surface import Bounds, ramp_bounds
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.config import MeanConfig, RevolutionConfig
from brrp_cli.geometry import normalise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Roundness:
    """How far points are those of a surface of revolution.

    aside : share of the points whose normals lean away from the axis enough to tell; round : share
    of these whose normals meet it; covered : share of a turn from which they are seen; scatter :
    metres that nine in ten of all stay within, off the mean of those that the turn brings there
    """

    aside: float
    round: float
    covered: float
    scatter: float

    def enough(self, config: RevolutionConfig) -> bool:
        """Whether they are."""
        return (
            self.aside >= config.least_aside
            and self.round >= config.least_round
            and self.covered >= config.least_covered
            and self.scatter <= config.most_scatter
        )


def revolution(part: VisiblePart, config: RevolutionConfig) -> Axis | None:
    """The axis about which what is seen of an object is round; None if it is not, or if too little
    is seen to tell."""
    points, normals = part.seen, part.normals
    if not config.enabled or len(points) < config.least_points:
        return None
    found = []
    for axis in (
        upright_axis(points, normals, part.up, config.off, config.steps),
        free_axis(points, normals, config.off, config.steps),
    ):
        roundness = roundness_about(axis, points, normals, config)
        if roundness.enough(config):
            found.append((roundness.scatter, axis))
    return min(found, key=lambda each: each[0])[1] if found else None


def roundness_about(
    axis: Axis, points: Array, normals: Array, config: RevolutionConfig
) -> Roundness:
    """Of points (n, 3) with unit normals (n, 3), metres."""
    leaning = np.linalg.norm(np.cross(normals, axis.direction), axis=1) > config.aside
    meets = axis.turned_off(points, normals) < config.meets
    told = leaning & meets
    first = normalise(np.cross(axis.direction, np.roll(axis.direction, 1) + [0.3, 0.1, 0.2]))
    second = np.cross(axis.direction, first)
    turn = np.arctan2(normals[told] @ second, normals[told] @ first) / (2 * np.pi) + 0.5
    sector = np.minimum((turn * config.sectors).astype(np.int64), config.sectors - 1)
    count = np.bincount(sector, minlength=config.sectors)
    return Roundness(
        aside=float(leaning.mean()),
        round=float(meets[leaning].mean()) if leaning.any() else 0.0,
        covered=float((count >= max(2.0, config.least_sector * told.sum())).mean()),
        scatter=float(np.quantile(_scatter(axis, points, normals, config.neighbours), 0.9)),
    )


def turned(axis: Axis, points: Array, turns: int) -> Array:
    """Points (n, 3) at each of so many turns about the axis, (turns * n, 3)."""
    height = axis.heights(points)
    radius, _ = axis.radii(points)
    first = normalise(np.cross(axis.direction, np.roll(axis.direction, 1) + [0.3, 0.1, 0.2]))
    second = np.cross(axis.direction, first)
    angle = np.arange(turns) * (2 * np.pi / turns)
    around = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    along = axis.point + height[:, None] * axis.direction
    return np.asarray((along + radius[:, None] * around[:, None]).reshape(-1, 3))


def round_logits(
    axis: Axis,
    nodes: Array,
    empty: NDArray[np.bool_],
    guess: NDArray[np.floating],
    part: VisiblePart,
    shell: float,
    config: MeanConfig,
) -> NDArray[np.float32]:
    """Logits (nx, ny, nz) at nodes (nx, ny, nz, 3), metres, camera frame, of an object that is
    round about the axis.

    empty : of the nodes; guess : the network's logits, anything where it is empty; shell : metres,
    how thick what was seen is
    """
    own = config.revolution
    spacing = float(np.linalg.norm(nodes[1, 0, 0] - nodes[0, 0, 0]))
    rings = _Rings(axis, nodes.reshape(-1, 3), own.cell * spacing)
    free = rings.mean(empty.ravel().astype(np.float64)) > own.free
    thought = rings.mean(np.clip(guess, -config.limit, config.limit).ravel(), ~empty.ravel())
    # Of what stands out of a ring that is free elsewhere the turn knows nothing.
    explained = ~(rings.at(free.astype(np.float64), axis, part.seen) > 0.5)
    bounds = _bounds(axis, rings, part.seen[explained], part.normals[explained], shell, config)
    ring = bounds.applied(np.where(free, -config.limit, thought).ravel()).reshape(free.shape)
    found = rings.at_nodes(ring).astype(np.float32)
    if not explained.all():
        _, nearest = part.tree.query(nodes.reshape(-1, 3))
        apart = ~explained[nearest]
        found[apart] = np.maximum(found, guess.ravel())[apart]
    return found.reshape(guess.shape)


class _Rings:
    """Rings about an axis, in cells of `cell` metres, (heights, radii)."""

    def __init__(self, axis: Axis, points: Array, cell: float) -> None:
        self.cell = cell
        height, radius = axis.heights(points), axis.radii(points)[0]
        self.low = float(height.min())
        self._at = np.stack([(height - self.low) / cell, radius / cell])
        index = np.rint(self._at).astype(np.int64)
        self.shape = tuple(int(n) + 1 for n in index.max(axis=1))
        self._index = np.ravel_multi_index(tuple(index), self.shape)

    @property
    def centres(self) -> Array:
        """(cells, 2) heights and radii, metres."""
        rows, columns = np.indices(self.shape)
        return np.stack([self.low + self.cell * rows.ravel(), self.cell * columns.ravel()], axis=1)

    def mean(self, values: NDArray[np.floating], of: NDArray[np.bool_] | None = None) -> Array:
        """Of values (n,) of the points, over each ring; 0 where there are none."""
        index = self._index if of is None else self._index[of]
        values = values if of is None else values[of]
        size = int(np.prod(self.shape))
        count = np.bincount(index, minlength=size)
        total = np.bincount(index, values, minlength=size)
        return np.asarray((total / np.maximum(count, 1)).reshape(self.shape))

    def at_nodes(self, values: Array) -> Array:
        """Values of the rings at the points, linear between."""
        return np.asarray(map_coordinates(values, self._at, order=1, mode="nearest"))

    def at(self, values: Array, axis: Axis, points: Array) -> Array:
        """The same at other points (n, 3)."""
        at = [(axis.heights(points) - self.low) / self.cell, axis.radii(points)[0] / self.cell]
        return np.asarray(map_coordinates(values, np.stack(at), order=1, mode="nearest"))


def _bounds(
    axis: Axis, rings: _Rings, points: Array, normals: Array, shell: float, config: MeanConfig
) -> Bounds:
    """Of the logits of all rings (cells,), from seen points (n, 3) with normals (n, 3)."""
    centres = rings.centres
    least = np.full(len(centres), -config.limit)
    most = np.full(len(centres), config.limit)
    flat, across = _in_half_plane(axis, points, normals)
    # The two sides of a wall are near one another, and face away from one another.
    for side in (across[:, 1] >= 0, across[:, 1] < 0):
        if side.sum() < config.revolution.neighbours:
            continue
        distance, rows = cKDTree(flat[side]).query(centres, k=config.revolution.neighbours)
        near = distance[:, 0] < 1.5 * shell
        rows = rows[near]
        normal = normalise(across[side][rows].mean(axis=1) + np.finfo(float).tiny)
        middle = flat[side][rows].mean(axis=1)
        behind = ((middle - centres[near]) * normal).sum(axis=1)
        beside = np.linalg.norm(centres[near] - flat[side][rows[:, 0]], axis=1)
        told = beside < np.maximum(np.abs(behind), config.revolution.most_scatter) * 1.5
        ramp = ramp_bounds(behind, told, told, shell, config)
        least[near] = np.maximum(least[near], ramp.least)
        most[near] = np.minimum(most[near], ramp.most)
    return Bounds(least, most)


def _scatter(axis: Axis, points: Array, normals: Array, neighbours: int) -> Array:
    """Metres (n,) by which points (n, 3) are off their neighbours after they are turned."""
    flat, across = _in_half_plane(axis, points, normals)
    found = np.zeros(len(points))
    for side in (across[:, 1] >= 0, across[:, 1] < 0):
        count = min(neighbours, int(side.sum()))
        if count < 2:
            continue
        _, rows = cKDTree(flat[side]).query(flat[side], k=count)
        normal = normalise(across[side][rows].mean(axis=1) + np.finfo(float).tiny)
        off = ((flat[side][:, None] - flat[side][rows]) * normal[:, None]).sum(axis=-1)
        found[side] = np.sqrt(np.square(off).mean(axis=1))
    return found


def _in_half_plane(axis: Axis, points: Array, normals: Array) -> tuple[Array, Array]:
    """Heights and radii (n, 2), metres, and unit normals (n, 2) there."""
    radius, away = axis.radii(points)
    flat = np.stack([axis.heights(points), radius], axis=1)
    across = np.stack([normals @ axis.direction, (normals * away).sum(axis=1)], axis=1)
    return flat, normalise(across + np.finfo(float).tiny)
