"""Rectangles that points of a plane lie along, found by what is sharp in their projections."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import BinsConfig


def rectangles(points: NDArray[np.float64], config: BinsConfig) -> Iterator[NDArray[np.float64]]:
    """Rectangles, hulls (4, 3), on whose sides many of the points (n, 2) lie, whatever lies
    elsewhere.

    In the direction of the sides, many points have one coordinate.
    """
    middle = points.mean(axis=0)
    turns = np.arange(0.0, np.pi / 2, config.turn)
    u, v = max(
        (np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) for turn in turns),
        key=lambda axes: _sharpness(points - middle, axes, config.cell),
    )
    x, y = (points - middle) @ u, (points - middle) @ v
    for left, right in combinations(_sides(x, config), 2):
        for near, far in combinations(_sides(y, config), 2):
            if (right - left) * (far - near) < config.rectangle:
                continue
            on = np.minimum.reduce([abs(x - left), abs(x - right), abs(y - near), abs(y - far)])
            within = (x > left) & (x < right) & (y > near) & (y < far)
            on_sides = ((on < config.cell) & (within | (on < config.cell / 2))).sum()
            if on_sides * config.cell < config.shown * (right - left + far - near):
                continue
            sides = [(u, right), (-u, -left), (v, far), (-v, -near)]
            yield np.array([[*axis, -(side + axis @ middle)] for axis, side in sides])


def _sharpness(points: NDArray[np.float64], axes: NDArray[np.float64], cell: float) -> float:
    """How much points share their coordinates along both axes."""
    return sum(float((np.square(_spread(along, cell)[0])).sum()) for along in axes @ points.T)


def _spread(along: NDArray[np.float64], cell: float) -> tuple[NDArray[np.int64], float]:
    """How many coordinates lie in each cell, and where the first one begins."""
    first = float(along.min())
    return np.bincount(((along - first) / cell).astype(np.int64)), first


def _sides(along: NDArray[np.float64], config: BinsConfig) -> list[float]:
    """The coordinates that most points share, in ascending order."""
    counts, first = _spread(along, config.cell)
    sides: list[float] = []
    for index in np.argsort(-counts, kind="stable"):
        at = first + (int(index) + 0.5) * config.cell
        if all(abs(at - side) > config.apart for side in sides):
            sides.append(at)
        if len(sides) == config.sides:
            break
    return sorted(sides)
