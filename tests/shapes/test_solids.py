"""Solids: volumes against closed formulas, sizes as asked."""

import numpy as np
import pytest

from brrp_cli.shapes import kinds, solids

# Area of the polygon that stands for a circle of radius 1.
POLYGON = solids.SECTIONS / 2 * np.sin(2 * np.pi / solids.SECTIONS)


def frustum(r, R, h):
    return POLYGON * h / 3 * (r * r + r * R + R * R)


def zone(radius, middle, low, high):
    """Volume of a sphere between two heights."""
    return np.pi * (radius**2 * (high - low) - ((high - middle) ** 3 - (low - middle) ** 3) / 3)


def test_box_volume_and_place():
    mesh = solids.box(0.1, 0.2, 0.3)
    assert mesh.volume == pytest.approx(0.006)
    np.testing.assert_allclose(mesh.bounds, [[-0.05, -0.1, 0], [0.05, 0.1, 0.3]])


def test_cylinder_volume_is_that_of_its_polygon():
    mesh = solids.cylinder(0.04, 0.1)
    assert mesh.volume == pytest.approx(POLYGON * 0.04**2 * 0.1)
    np.testing.assert_allclose(mesh.bounds, [[-0.04, -0.04, 0], [0.04, 0.04, 0.1]], atol=1e-12)


def test_ball_volume_and_radius():
    mesh = solids.ball(0.05)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.01)
    distance = np.linalg.norm(mesh.vertices - [0, 0, 0.05], axis=1)
    np.testing.assert_allclose(distance, 0.05, atol=1e-12)


def test_beaker_volume_is_outer_frustum_less_inner_frustum():
    bottom, top, height, t = 0.03, 0.04, 0.1, 0.004
    inner_bottom = bottom + (top - bottom) / height * t - t
    expected = frustum(bottom, top, height) - frustum(inner_bottom, top - t, height - t)
    assert solids.beaker(bottom, top, height, t).volume == pytest.approx(expected)


def test_bowl_shell_volume_is_the_difference_of_two_spherical_zones():
    base, rim, height, t = 0.035, 0.08, 0.055, 0.005
    middle, radius = solids.bowl_sphere(base, rim, height)
    assert np.hypot(rim, height - middle) == pytest.approx(radius)
    expected = zone(radius, middle, 0, height) - zone(radius - t, middle, t, height)
    mesh = solids.spherical_bowl(base, rim, height, t)
    assert mesh.volume == pytest.approx(expected, rel=0.01)
    np.testing.assert_allclose(mesh.extents, [2 * rim, 2 * rim, height], rtol=1e-9)


def test_a_straight_tube_is_a_cylinder_along_its_line():
    line = np.column_stack([np.linspace(-0.1, 0.1, 5), np.full(5, 0.03)])
    mesh = solids.tube(line, np.full(5, 0.02))
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(POLYGON * 0.02**2 * 0.2)
    np.testing.assert_allclose(mesh.bounds, [[-0.1, -0.02, 0.01], [0.1, 0.02, 0.05]], atol=1e-12)


def test_a_bent_tube_has_pappus_volume():
    angle = np.linspace(0, np.pi / 2, 200)
    mesh = solids.tube(0.1 * np.column_stack([np.cos(angle), np.sin(angle)]), np.full(200, 0.02))
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(POLYGON * 0.02**2 * 0.1 * np.pi / 2, rel=1e-3)


def test_laying_down_turns_height_into_length():
    mesh = solids.laid_down(solids.cylinder(0.02, 0.2))
    np.testing.assert_allclose(mesh.bounds, [[-0.1, -0.02, 0], [0.1, 0.02, 0.04]], atol=1e-12)
    assert mesh.is_volume


def test_squeezing_scales_one_width():
    mesh = solids.squeezed(solids.cylinder(0.05, 0.1), 0.5)
    np.testing.assert_allclose(mesh.extents, [0.1, 0.05, 0.1])
    assert mesh.volume == pytest.approx(POLYGON * 0.05**2 * 0.1 / 2)


def test_booleans_are_exact():
    a, b = solids.box(0.1, 0.1, 0.1), solids.moved(solids.box(0.1, 0.1, 0.1), x=0.05)
    assert solids.union(a, b).volume == pytest.approx(0.0015)
    assert solids.difference(a, b).volume == pytest.approx(0.0005)
    assert a.bounds[0, 0] == pytest.approx(-0.05)


@pytest.mark.parametrize(
    ("mesh", "extents"),
    [
        (kinds.bottle(0.04, 0.2, 0.015, 0.03, 0.04), (0.08, 0.08, 0.2)),
        (kinds.mug(0.04, 0.09, 0.005, 0.03), (0.11, 0.08, 0.09)),
        (kinds.plate(0.12, 0.025, 0.006, 0.07), (0.24, 0.24, 0.025)),
        (kinds.screwdriver(0.2, 0.1, 0.015), (0.2, 0.03, 0.03)),
        (kinds.hammer(0.3, 0.12, 0.014), (0.3, 0.12, 0.0308)),
    ],
    ids=["bottle", "mug", "plate", "screwdriver", "hammer"],
)
def test_kinds_have_the_asked_extents(mesh, extents):
    np.testing.assert_allclose(mesh.extents, extents, atol=2e-4)


def test_a_mug_is_a_cup_with_a_ring_through_which_a_finger_goes():
    mesh = kinds.mug(0.042, 0.095, 0.005, 0.035)
    cup = solids.beaker(0.042, 0.042, 0.095, 0.005)
    assert mesh.volume > cup.volume
    assert mesh.euler_number == 0  # one handle: genus 1
    assert cup.euler_number == 2
    hollow = solids.moved(solids.cylinder(0.0365, 0.089), z=0.0055)
    assert solids.difference(hollow, mesh).volume == pytest.approx(hollow.volume)
