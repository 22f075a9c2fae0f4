"""Axes of surfaces of revolution, from half of their points and normals."""

from __future__ import annotations

import numpy as np
import pytest
from turned_shapes import frustum, turned_and_moved

from brrp_cli.completion.revolution_axis import Axis, free_axis, upright_axis

UP = np.array([0.0, 0.0, 1.0])
SHAPES = {"can": (0.04, 0.04, 0.1), "cup": (0.03, 0.05, 0.1), "cone": (0.005, 0.06, 0.05)}


def off_axis(axis, point, direction):
    """Metres between a point of the true axis and the axis, and degrees between the two."""
    across = np.linalg.norm(np.cross(point - axis.point, axis.direction))
    return across, np.degrees(np.arcsin(np.linalg.norm(np.cross(axis.direction, direction))))


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_an_upright_axis_is_found_from_the_half_that_is_seen(shape):
    points, normals = frustum(*shape, noise=0.05)
    axis = upright_axis(points + [0.2, 0.1, 0.7], normals, UP, 0.2, 8)
    across, degrees = off_axis(axis, np.array([0.2, 0.1, 0.7]), UP)
    assert across < 0.001 and degrees == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_any_axis_is_found_from_the_half_that_is_seen(shape, seed):
    points, normals, T = turned_and_moved(*frustum(*shape, noise=0.05), seed)
    axis = free_axis(points, normals, 0.2, 8)
    middle = T[:3, :3] @ [0, 0, shape[2] / 2] + T[:3, 3]
    across, degrees = off_axis(axis, middle, T[:3, 2])
    assert across < 0.0015 and degrees < 2


def test_exact_normals_give_the_exact_axis():
    points, normals, T = turned_and_moved(*frustum(*SHAPES["cup"]))
    axis = free_axis(points, normals, 0.2, 8)
    across, degrees = off_axis(axis, T[:3, 3], T[:3, 2])
    assert across < 2e-4 and degrees < 0.2
    assert axis.turned_off(points, normals).max() < 0.01


def test_a_handle_does_not_move_the_axis():
    points, normals = frustum(*SHAPES["can"], noise=0.05)
    rng = np.random.default_rng(1)
    handle = np.stack(
        [rng.uniform(0, 0.01, 100), rng.uniform(0.04, 0.07, 100), rng.uniform(0.03, 0.07, 100)], 1
    )
    aside = rng.normal(size=(100, 3))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    axis = upright_axis(
        np.concatenate([points, handle]), np.concatenate([normals, aside]), UP, 0.2, 8
    )
    assert np.linalg.norm(axis.point[:2]) < 0.001


def test_turned_points_keep_their_heights_and_radii():
    axis = Axis(np.array([0.1, 0.2, 0.9]), np.array([0.6, 0.0, 0.8]))
    points = np.random.default_rng(0).normal(size=(50, 3))
    turned = axis.turned(points, 6)
    assert turned.shape == (300, 3)
    assert np.allclose(axis.half_plane(turned), np.tile(axis.half_plane(points), (6, 1)))
    # All around: their mean is on the axis.
    middle = turned.reshape(6, 50, 3).mean(axis=0)
    assert np.allclose(axis.radii(middle)[0], 0, atol=1e-9)


def test_sides_are_across_the_axis_whichever_way_it_points():
    for direction in (*np.eye(3), np.array([0.6, -0.8, 0.0])):
        axes = np.stack([direction, *Axis(np.zeros(3), direction).sides])
        assert np.allclose(axes @ axes.T, np.eye(3))


def test_normals_in_the_half_plane_of_a_cone_are_all_the_same():
    points, normals = frustum(*SHAPES["cup"])
    across = Axis(np.zeros(3), UP).normals_in_half_plane(points, normals)
    assert np.allclose(across, across[0], atol=1e-6)
    assert across[0] == pytest.approx(np.array([-0.02, 0.1]) / np.hypot(0.02, 0.1), abs=1e-6)
