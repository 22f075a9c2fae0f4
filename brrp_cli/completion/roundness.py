"""Whether what is seen of an object is a surface of revolution, and about which axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brrp_cli.completion.revolution_axis import Axis, free_axis, upright_axis
from brrp_cli.config import RevolutionConfig
from brrp_cli.geometry import normalise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Roundness:
    """How far points are those of a surface of revolution.

    aside : share of the points whose normals lean away from the axis enough to tell; round : share
    of these whose normals meet it; covered : share of a turn over which these are spread; scatter :
    metres within which a share `within` of the points lies of those that the turn brings beside
    them; oval : by
    which share of its radius it is wider one way than across
    """

    aside: float
    round: float
    covered: float
    scatter: float
    oval: float

    def enough(self, config: RevolutionConfig) -> bool:
        """Whether they are."""
        return (
            self.aside >= config.least_aside
            and self.round >= config.least_round
            and self.covered >= config.least_covered
            and self.scatter <= config.most_scatter
            and self.oval <= config.most_oval
        )


def axis_of(points: Array, normals: Array, up: Array, config: RevolutionConfig) -> Axis | None:
    """The axis about which points (n, 3) with unit normals (n, 3), metres, are round; None if they
    are not, or too few to tell. An upright axis, along `up` (3,), is taken where it is as good."""
    if not config.enabled or len(points) < config.least_points:
        return None
    step = -(-len(points) // config.most_points)
    points, normals = points[::step], normals[::step]
    found = []
    for axis, counts in (
        (upright_axis(points, normals, up, config.off, config.steps), 1.0),
        (free_axis(points, normals, config.off, config.steps), config.leaning),
    ):
        roundness = roundness_about(axis, points, normals, config)
        if roundness.enough(config):
            found.append((counts * roundness.scatter, axis))
    return min(found, key=lambda each: each[0])[1] if found else None


def roundness_about(
    axis: Axis, points: Array, normals: Array, config: RevolutionConfig
) -> Roundness:
    """Of points (n, 3) with unit normals (n, 3), metres."""
    leans = np.linalg.norm(np.cross(normals, axis.direction), axis=1) > config.aside
    meets = axis.turned_off(points, normals) < config.meets
    told = normals[leans & meets]
    turn = np.arctan2(*(told @ axis.sides.T).T) / (2 * np.pi) + 0.5
    sector = np.minimum((turn * config.sectors).astype(np.int64), config.sectors - 1)
    count = np.bincount(sector, minlength=config.sectors)
    return Roundness(
        aside=float(leans.mean()),
        round=float(meets[leans].mean()) if leans.any() else 0.0,
        covered=float((count >= max(2.0, config.least_sector * len(told))).mean()),
        scatter=float(
            np.quantile(_scatter(axis, points, normals, config.neighbours), config.within)
        ),
        oval=_oval(axis, points[meets], normals[meets], config),
    )


def sides(across: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which normals (n, 2) of the half plane face away from the axis, and which towards it: the two
    sides of a wall are beside one another."""
    outer = across[:, 1] >= 0
    return outer, ~outer


def mean_normals(across: Array, rows: NDArray[np.int64]) -> Array:
    """Unit normals (m, 2) of neighbours with normals (n, 2), their rows (m, k)."""
    return normalise(across[rows].mean(axis=1) + np.finfo(float).tiny)


def _oval(axis: Axis, points: Array, normals: Array, config: RevolutionConfig) -> float:
    """The axis of something oval is in its middle, and every normal nearly meets it. But its radius
    changes twice as fast as the turn: r (1 + e cos 2 (turn - first)) is wider by 2 e one way."""
    across = axis.normals_in_half_plane(points, normals)[:, 1]
    # Of a wall, the side of which more is seen.
    side = max((across > config.aside, across < -config.aside), key=np.count_nonzero)
    if side.sum() < config.neighbours:
        return 0.0
    points = points[side]
    height, radius = axis.half_plane(points).T
    turn = np.arctan2(*(axis.radii(points)[1] @ axis.sides.T).T)
    low, high = height.min(), height.max()
    level = np.rint((height - low) / max(high - low, 1e-9) * (config.levels - 1)).astype(np.int64)
    count = np.bincount(level)

    def beside_mean(values: Array) -> Array:
        return values - (np.bincount(level, values) / np.maximum(count, 1))[level]

    mean = np.maximum(radius - beside_mean(radius), 1e-9)
    relative = beside_mean(radius) / mean
    # Noise is as high on a thin stem as on a wide bowl, and a larger share of its radius.
    says = (mean / mean.max()) ** 2
    # An axis that is not quite in the middle shows once in a turn.
    waves = [wave(k * turn) for k in (1, 2) for wave in (np.cos, np.sin)]
    A = np.stack([beside_mean(each) for each in waves], axis=1)
    weight, found = says, np.zeros(4)
    for _ in range(config.steps):
        weighed = A * weight[:, None]
        # Waves that what is seen of a turn does not tell apart count as none.
        held = weighed.T @ A + config.untold * says.sum() * np.eye(4)
        found = np.linalg.solve(held, weighed.T @ relative)
        weight = says / (1 + ((relative - A @ found) / config.strays) ** 2)
    return 2 * float(np.hypot(*found[2:]))


def _scatter(axis: Axis, points: Array, normals: Array, neighbours: int) -> Array:
    """Metres (n,) by which points (n, 3) are off those that the turn brings beside them."""
    flat, across = axis.half_plane(points), axis.normals_in_half_plane(points, normals)
    found = np.zeros(len(points))
    for side in sides(across):
        count = min(neighbours, int(side.sum()))
        if count < 2:
            continue
        _, rows = cKDTree(flat[side]).query(flat[side], k=count)
        normal = mean_normals(across[side], rows)
        off = ((flat[side][:, None] - flat[side][rows]) * normal[:, None]).sum(axis=-1)
        found[side] = np.sqrt(np.square(off).mean(axis=1))
    return found
