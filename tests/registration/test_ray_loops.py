"""The pull of observed points along their rays is the slope of what they cost."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.geometry import normalise
from brrp_cli.registration.ray_loops import pull_of_rays

OUTLIER, INDEPENDENT, PIXEL = 3.0, 0.05, 1 / 600
MIDDLE = np.array([0.0, 0.0, 0.6])


@pytest.fixture
def seen():
    """Points, where their rays meet a surface, its normals there, deviations along the rays."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.05, -0.05, 0.55], [0.05, 0.05, 0.65], (40, 3))
    away = normalise(rng.normal(size=(40, 3)) * 0.4 - [0, 0, 1])
    on_surface = points - rng.normal(scale=0.001, size=(40, 1)) * away
    return points, on_surface, away, rng.uniform(0.0012, 0.002, 40)


def pull(points, on_surface, away, along):
    return pull_of_rays(points, on_surface, away, MIDDLE, along, PIXEL, OUTLIER, INDEPENDENT)


def test_points_on_the_surface_cost_nothing_and_do_not_pull(seen):
    points, _, away, along = seen
    cost, _, fall = pull(points, points, away, along)
    assert cost == 0
    np.testing.assert_array_equal(fall, 0)


def test_a_shift_along_the_pull_lowers_the_cost_by_as_much_as_it_says(seen):
    points, on_surface, away, along = seen
    cost, _, fall = pull(points, on_surface, away, along)
    small = 1e-7
    for axis in range(3):
        shifted = on_surface + small * np.eye(3)[axis]
        slope = (pull(points, shifted, away, along)[0] - cost) / small
        assert slope == pytest.approx(-fall[3 + axis], rel=1e-3)


def test_a_turn_moves_the_surface_as_its_row_says(seen):
    points, on_surface, away, along = seen
    cost, _, fall = pull(points, on_surface, away, along)
    small = 1e-6
    for axis in range(3):
        turned = on_surface + small * np.cross(np.eye(3)[axis], on_surface - MIDDLE)
        slope = (pull(points, turned, away, along)[0] - cost) / small
        assert slope == pytest.approx(-fall[axis], rel=1e-3)


def test_what_is_far_off_costs_a_fixed_amount_and_does_not_pull(seen):
    points, _, away, along = seen
    cost, normal, fall = pull(points, points - 0.05 * away, away, along)
    assert cost == pytest.approx(len(points) * INDEPENDENT * OUTLIER**2 / 6)
    np.testing.assert_array_equal(normal, 0)
    np.testing.assert_array_equal(fall, 0)
