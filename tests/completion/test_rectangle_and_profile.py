"""The rectangle that a thing stands on, and its radius at each height."""

import numpy as np
import pytest

from brrp_cli.completion.plan_rectangle import plan_rectangle
from brrp_cli.completion.radial_profile import radial_profile
from brrp_cli.config import CompletionConfig

CONFIG = CompletionConfig()
LEVELS = CONFIG.levels


def turned(points, angle):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 2.5])
def test_two_sides_of_a_box_give_its_rectangle(angle):
    """Two sides that meet at a corner span the whole rectangle, whichever way it is turned."""
    line = np.linspace(0, 1, 200)
    sides = np.concatenate([np.outer(line, [0.12, 0]), np.outer(line, [0, 0.05])])
    found = plan_rectangle(turned(sides, angle) + [0.3, -0.2], CONFIG)
    np.testing.assert_allclose(found.half, [0.06, 0.025], atol=0.003)
    middle, corner, out = turned(
        np.array([[0.06, 0.025], [0.119, 0.049], [0.06, 0.075]]), angle
    ) + [0.3, -0.2]
    np.testing.assert_allclose(found.centre, middle, atol=0.003)
    far = found.outside(np.stack([middle, corner, out]))
    np.testing.assert_allclose(far, [-0.025, 0, 0.025], atol=0.004)


@pytest.mark.parametrize("angle", [0.2, 1.0])
def test_a_full_rectangle_is_found_too(angle):
    points = np.random.default_rng(0).uniform(-1, 1, (2000, 2)) * [0.06, 0.04]
    found = plan_rectangle(turned(points, angle), CONFIG)
    np.testing.assert_allclose(found.half, [0.06, 0.04], atol=0.004)


def test_strays_do_not_widen_the_rectangle():
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (2000, 2)) * [0.05, 0.02]
    points[:5] += 0.5
    assert plan_rectangle(points, CONFIG).half[0] < 0.06


def test_a_rectangle_of_one_point_has_sides():
    found = plan_rectangle(np.zeros((1, 2)), CONFIG)
    assert (found.half > 0).all() and np.isfinite(found.outside(np.ones((3, 2)))).all()


def bowl(count=4000):
    """A cone whose outer radius grows from 3 to 8 cm over 5 cm, with walls of 5 mm: the outer
    surface's half towards the camera, the inner's other half."""
    rng = np.random.default_rng(0)
    height, angle = rng.uniform(0, 0.05, count), rng.uniform(0, np.pi, count)
    outer = angle < np.pi / 2
    radii = 0.03 + height - np.where(outer, 0, 0.005)
    return height, radii, np.where(outer, 1.0, -1.0)


def test_the_wall_of_a_bowl_lies_between_its_radii():
    profile = radial_profile(*bowl(), LEVELS)
    heights = np.array([0.01, 0.025, 0.04])
    outer, inner = profile.radii(heights)
    np.testing.assert_allclose(outer, 0.03 + heights, atol=0.001)
    np.testing.assert_allclose(inner, 0.025 + heights, atol=0.001)


def test_a_can_has_no_inner_radius_and_gaps_are_filled():
    height = np.concatenate([np.linspace(0, 0.03, 200), np.linspace(0.09, 0.12, 200)])
    profile = radial_profile(height, np.full(400, 0.04), np.ones(400), LEVELS)
    outer, inner = profile.radii(np.array([0.0, 0.06, 0.12, 0.2]))
    np.testing.assert_allclose(outer, 0.04)
    assert (inner == 0).all()


def test_what_only_faces_the_axis_has_an_outer_radius_too():
    profile = radial_profile(np.linspace(0, 0.1, 50), np.full(50, 0.04), -np.ones(50), LEVELS)
    outer, inner = profile.radii(np.array([0.05]))
    np.testing.assert_allclose([outer[0], inner[0]], 0.04)
