"""A plane through a heap of things, and the table that bears them."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.config.observation import HeapConfig
from brrp_cli.observation.lowered import lowered, lowest
from brrp_cli.observation.patches import Ransac
from brrp_cli.observation.support_plane import Plane

CONFIG = HeapConfig()
RANSAC = Ransac(tolerance=0.01, iterations=500, drawn_points=2000, min_points=100)
FACING = np.array([0.0, 0.0, -1.0])  # the camera, one metre above a table


def scattered(count: int, size: float, rng: np.random.Generator) -> np.ndarray:
    """(n, 2) metres about the optical axis."""
    return rng.uniform(-size / 2, size / 2, (count, 2))


def heap(on_table: int, on_things: int, height: float = 0.08) -> np.ndarray:
    """Points of a table that is thinly seen, and of things on it: their tops, a little tilted, and
    their sides."""
    rng = np.random.default_rng(0)
    flat, top, side = (
        scattered(n, size, rng)
        for n, size in ((on_table, 0.8), (on_things, 0.3), (on_things // 2, 0.3))
    )
    return np.concatenate(
        [
            np.column_stack([flat, np.full(len(flat), 1.0)]),
            np.column_stack([top, 1.0 - height + 0.1 * top[:, 0]]),
            np.column_stack([side, 1.0 - rng.uniform(0, height, len(side))]),
        ]
    )


def test_a_plane_through_things_is_lowered_to_the_table_beneath_them():
    points = heap(on_table=3000, on_things=10_000)
    normal = np.array([0.1, 0.0, -1.0])
    tops = Plane(normal / np.linalg.norm(normal), 0.92 / np.linalg.norm(normal))
    assert (np.abs(tops.signed_distance(points)) < 0.01).sum() > 2 * 3000
    table = lowered(tops, points, 0, CONFIG, RANSAC)
    assert table.normal @ FACING > np.cos(np.radians(0.7))
    assert table.offset == pytest.approx(1.0, abs=0.003)


def test_a_table_stays_whatever_lies_on_it_or_far_beneath_it():
    points = heap(on_table=10_000, on_things=10_000)
    floor = np.column_stack(
        [scattered(30_000, 3.0, np.random.default_rng(1)), np.full(30_000, 1.7)]
    )
    table = Plane(FACING, 1.0)
    assert lowered(table, np.concatenate([points, floor]), 0, CONFIG, RANSAC) is table


def test_a_face_with_things_behind_it_is_not_turned_to_another_side():
    """All that lies beneath it is a plane square to it."""
    rng = np.random.default_rng(0)
    face = np.column_stack([scattered(2000, 0.4, rng), np.full(2000, 1.0)])
    upright = np.column_stack(
        [np.full(2000, 0.1), rng.uniform(-0.2, 0.2, 2000), rng.uniform(1.0, 1.12, 2000)]
    )
    plane = Plane(FACING, 1.0)
    assert lowered(plane, np.concatenate([face, upright]), 0, CONFIG, RANSAC) is plane


def test_the_lowest_points_are_one_for_each_cell():
    plane = Plane(FACING, 1.0)
    column = np.array([[0.005, 0.005, z] for z in (1.03, 1.0, 0.95, 0.99)])
    aside = np.array([[0.105, 0.005, 0.95], [0.005, 0.205, 1.2]])
    found = lowest(plane, np.concatenate([column, aside]), CONFIG)
    assert sorted(map(tuple, found)) == [(0.005, 0.005, 1.03), (0.105, 0.005, 0.95)]
