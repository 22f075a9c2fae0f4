"""Convex hulls in the plane: known answers, and the hull of many points is that of all of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from brrp_cli.hulls import BLOCK, MANY, beyond_hull, convex_hull, in_hull

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0]])


def in_order(hull: NDArray[np.float64]) -> NDArray[np.float64]:
    return hull[np.lexsort(hull.T)]


def test_a_square_holds_what_lies_in_it_and_on_its_sides() -> None:
    hull = convex_hull(SQUARE)
    assert hull is not None and len(hull) == 4
    points = np.array([[1.0, 1.0], [2.0, 1.0], [2.1, 1.0], [-0.5, 3.0], [np.nan, 1.0]])
    assert in_hull(hull, points, 0.0).tolist() == [True, True, False, False, False]
    assert in_hull(hull, points, 0.2).tolist() == [True, True, True, False, False]
    # Beyond a corner, the farther of two sides.
    np.testing.assert_allclose(beyond_hull(hull, points), [-1.0, 0.0, 0.1, 1.0, np.nan], atol=1e-12)


def test_many_points_are_tested_as_each_of_them_is() -> None:
    hull = convex_hull(SQUARE)
    assert hull is not None
    points = np.random.default_rng(0).uniform(-1, 3, (3 * BLOCK + 7, 2)).astype(np.float32)
    x, y = points.astype(np.float64).T
    inside = (x >= 0) & (x <= 2) & (y >= 0) & (y <= 2)
    assert np.array_equal(in_hull(hull, points, 0.0), inside)
    assert np.array_equal(beyond_hull(hull, points) <= 0, inside)


@pytest.mark.parametrize("shape", ["disc", "rectangle", "grid"])
def test_the_hull_of_many_points_is_that_of_all_of_them(shape: str) -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (20 * MANY, 2)) * [1.2, 0.6]
    if shape == "disc":
        points = points[np.linalg.norm(points, axis=1) < 0.5]
    elif shape == "grid":
        points = np.round(points, 2)
    hull = convex_hull(points)
    assert hull is not None
    # All its corners, and nothing that rounding adds.
    expected = ConvexHull(points).equations
    assert len(hull) == len(expected)
    np.testing.assert_allclose(in_order(hull), in_order(expected), atol=1e-12)


@pytest.mark.parametrize("count", [3, 2 * MANY])
def test_what_has_no_area_has_no_hull(count: int) -> None:
    line = np.linspace(0.0, 1.0, count)
    assert convex_hull(np.stack([line, 2 * line], axis=1)) is None
    assert convex_hull(np.full((count, 2), np.nan)) is None
    assert convex_hull(np.zeros((count, 2))) is None
