"""Placements between those that are as probable: free turns are filled, half turns are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_around_mesh import region, shape_of

from brrp_cli.config import SurfaceConfig
from brrp_cli.surface.alike import every_alike
from brrp_cli.surface.around_mesh import out_to_reach, reach_of_alike

CONFIG = SurfaceConfig(around_nodes=400_000)


def with_turns(name, *vectors):
    """A shape that may as well be turned by these rotation vectors, degrees, in its own frame."""
    shape = shape_of(name)
    alike = np.tile(shape.T_cam_shape, (len(vectors), 1, 1))
    alike[:, :3, :3] = shape.T_cam_shape[:3, :3] @ Rotation.from_rotvec(
        np.radians(vectors)
    ).as_matrix().reshape(-1, 3, 3)
    return replace(shape, alike=alike)


def vectors_of(shape, found):
    """Rotation vectors (K, 3), degrees, of placements in the shape's own frame."""
    start = Rotation.from_matrix(shape.T_cam_shape[:3, :3] / shape.unit)
    return np.degrees(
        (start.inv() * Rotation.from_matrix(found[:, :3, :3] / shape.unit)).as_rotvec()
    )


def test_a_free_turn_is_filled_all_around():
    shape = with_turns("beaker", [0, 0, 40], [0, 0, -60], [0, 2, 110])
    vectors = vectors_of(shape, every_alike(shape, CONFIG)[3:])
    about = np.sort(np.append(vectors[:, 2], 0.0))
    assert np.abs(vectors[:, :2]).max() < 8
    assert np.diff(about).max() < np.degrees(CONFIG.turn_step) + 1
    assert about[0] < -160 and about[-1] > 160


@pytest.mark.parametrize("turns", [[[0, 0, 180]], [[0, 0, 90], [0, 0, 180], [0, 0, -90]]])
def test_what_is_symmetric_in_steps_stays_so(turns):
    shape = with_turns("box", *turns)
    assert len(every_alike(shape, CONFIG)) == len(turns)


def test_neighbours_about_several_axes_have_the_ways_between():
    shape = with_turns("box", [50, 0, 0], [0, 50, 0], [0, 0, 150])
    vectors = vectors_of(shape, every_alike(shape, CONFIG)[3:])
    assert len(vectors)
    for axis in (0, 1):
        only = np.abs(np.delete(vectors, axis, axis=1)).max(axis=1) < 1
        assert 0 < vectors[only, axis].max() < 50
    assert np.linalg.norm(vectors, axis=1).max() < 100


def test_nothing_is_alike_where_nothing_was():
    assert every_alike(shape_of("box"), CONFIG).shape == (0, 4, 4)


def test_a_part_of_the_vertices_tells_how_far_turns_reach():
    """A box that turns freely sweeps a round region, whichever of its vertices are looked at."""
    shape = with_turns("box", [0, 0, 40], [0, 0, -60], [0, 0, 110])
    every = reach_of_alike(shape, CONFIG)
    half = reach_of_alike(shape, replace(CONFIG, alike_vertices=len(every) // 2))
    assert every.max() > 0.005
    assert (half <= every + 1e-12).all()
    assert half.mean() == pytest.approx(every.mean(), rel=0.1)


def test_a_surface_of_a_coarse_grid_is_moved_out_to_its_reach():
    """On a grid as coarse as a wall is thick, marching cubes cut the region short."""
    shape = shape_of("beaker")
    reach = np.full(len(shape.vertices), 0.001)
    found = region(shape, reach, replace(CONFIG, around_nodes=20_000, around_finest=0.003))
    distance = shape.signed_distance(found.vertices, 0.01)
    assert distance.min() < 0.0007, "cut short"
    moved = out_to_reach(shape, np.asarray(found.vertices), reach)
    after = shape.signed_distance(moved, 0.01)
    # Where a side meets the bottom, the way out of one leads nearer to the other.
    assert after.min() > 0.0009 and np.mean(after > 0.00099) > 0.999
    stay = distance > 0.001
    assert moved[stay] == pytest.approx(found.vertices[stay], abs=1e-9)


def test_a_free_turn_goes_about_its_own_axis_and_not_that_of_the_box():
    shape = with_turns("beaker", [0, 0, 40], [0, 0, -60], [0, 0, 110])
    # The axis stands 20 mm beside the middle of the shape's box.
    middle = np.array([0.02, 0.0, 0.0]) / shape.unit
    inside = np.linalg.inv(shape.T_cam_shape) @ shape.alike
    inside[:, :3, 3] = middle - inside[:, :3, :3] @ middle
    shape = replace(shape, alike=shape.T_cam_shape @ inside)
    every = np.linalg.inv(shape.T_cam_shape) @ every_alike(shape, CONFIG)
    still = every[:, :3, :3] @ middle + every[:, :3, 3]
    assert len(every) > 20
    np.testing.assert_allclose(still, np.tile(middle, (len(every), 1)), atol=1e-6)


def test_half_turns_about_nearly_the_same_axis_are_no_free_turn():
    """A can on its head, turned as it may be, does not roll."""
    about = [[np.cos(angle), np.sin(angle), 0.0] for angle in (0.0, 0.06, 0.12)]
    shape = with_turns("beaker", *(180 * np.array(about)))
    vectors = vectors_of(shape, every_alike(shape, CONFIG))
    assert (np.linalg.norm(vectors, axis=1) > 150).all()
