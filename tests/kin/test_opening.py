"""How far one looks into a thing: nothing into solids, known depths into bowls."""

import numpy as np
import pytest

from brrp_cli.kin.opening import opening

EYE = np.array([0.0, 0.0, 1.0])
RNG = np.random.default_rng(0)


def cap(upward: bool) -> np.ndarray:
    """Half a sphere of radius 10 cm, rings of points at even heights, about the origin."""
    each = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 2 * np.pi, 60, endpoint=False))
    height, angle = (values.ravel() for values in each)
    round_ = np.sqrt(1 - height**2)
    z = height if upward else -height
    return 0.1 * np.column_stack([round_ * np.cos(angle), round_ * np.sin(angle), z])


def test_a_bowl_is_as_deep_as_it_is_and_a_ball_is_not():
    # A half sphere is half as deep as wide, and a tenth of its area lies in the lowest tenth.
    assert opening(cap(upward=False), EYE, 0.9) == pytest.approx(0.45, abs=0.01)
    assert opening(cap(upward=False), EYE, 0.5) == pytest.approx(0.25, abs=0.02)
    assert opening(cap(upward=True), EYE, 0.9) < 0.01


def test_two_sides_of_a_box_are_no_opening_and_the_same_two_from_within_are():
    u, v = RNG.uniform(0, 0.1, (2, 2000))
    wall, floor = np.column_stack([0 * u, u, v]), np.column_stack([v, u, 0 * u])
    corner = np.concatenate([wall, floor])
    assert opening(corner, np.array([-1.0, 0.05, -1.0]), 0.9) < 0.01
    assert opening(corner, np.array([1.0, 0.05, 1.0]), 0.9) > 0.3


@pytest.mark.parametrize(
    "points", [np.zeros((2, 3)), np.eye(3), RNG.uniform(size=(50, 1)) * [1, 2, 0]]
)
def test_what_has_no_volume_has_no_opening(points):
    assert opening(points, EYE, 0.9) == 0.0
