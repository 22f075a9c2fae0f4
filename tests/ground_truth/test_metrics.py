"""Shape metrics against values known in closed form."""

import math

import numpy as np
import pytest
import trimesh

from brrp_cli.errors import MeshError
from brrp_cli.ground_truth.metrics import (
    chamfer,
    evaluation_grid,
    f_score,
    iou,
    sample_surface,
)
from brrp_cli.raycast import inside


def cube(side: float, center=(0, 0, 0)) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((side, side, side))
    mesh.apply_translation(center)
    return mesh


def test_grid_is_the_published_one():
    grid = evaluation_grid(np.array([1.0, 2.0, 3.0]), half_width=0.2, spacing=0.015)
    assert grid.shape == (27**3, 3)
    np.testing.assert_allclose(grid.mean(axis=0), [1, 2, 3])
    np.testing.assert_allclose(grid.min(axis=0), [1 - 0.195, 2 - 0.195, 3 - 0.195])
    cubic = grid.reshape(27, 27, 27, 3)
    np.testing.assert_allclose(cubic[1, 0, 0] - cubic[0, 0, 0], [0.015, 0, 0])
    np.testing.assert_allclose(cubic[0, 0, 1] - cubic[0, 0, 0], [0, 0, 0.015])


def test_grid_reaches_its_half_width_when_steps_are_whole():
    grid = evaluation_grid(np.zeros(3), half_width=0.1, spacing=0.005)
    assert grid.shape == (41**3, 3)
    assert grid.max() == pytest.approx(0.1)


def test_iou_of_a_cube_and_itself_shifted_by_a_third_is_a_half():
    # Intersection 2/3, union 4/3 of the cube; no grid node lies on a face.
    grid = evaluation_grid(np.zeros(3), half_width=0.1, spacing=0.005)
    a, b = cube(0.1501, (-0.025, 0, 0)), cube(0.1501, (0.025, 0, 0))
    nodes_across, overlap = 31, 21
    expected = overlap / (2 * nodes_across - overlap)
    a_in, b_in = inside(a, grid), inside(b, grid)
    assert np.count_nonzero(a_in) == nodes_across**3
    assert iou(a_in, b_in) == pytest.approx(expected)
    assert expected == pytest.approx(0.5, abs=0.02)


def test_iou_is_one_zero_and_zero_for_equal_disjoint_and_empty():
    full, empty = np.ones(4, dtype=bool), np.zeros(4, dtype=bool)
    assert iou(full, full) == 1.0
    assert iou(full, empty) == 0.0
    assert iou(empty, empty) == 0.0


def test_chamfer_of_concentric_spheres_is_twice_the_difference_of_radii():
    rng = np.random.default_rng(0)
    small, large = (
        sample_surface(trimesh.creation.icosphere(5, radius), 8000, rng) for radius in (0.1, 0.13)
    )
    # Finite sampling adds a little sideways distance, never takes any away.
    assert chamfer(small, large) == pytest.approx(0.06, abs=0.0005)
    assert chamfer(small, large) == chamfer(large, small)


def test_chamfer_of_point_sets_counted_by_hand():
    a = np.array([[0.0, 0, 0], [1, 0, 0]])
    b = np.array([[0.0, 0, 0]])
    assert chamfer(a, b) == pytest.approx(0.5 + 0.0)


def test_an_empty_reconstruction_has_no_chamfer_and_an_f_score_of_zero():
    points = np.zeros((3, 3))
    assert math.isnan(chamfer(np.zeros((0, 3)), points))
    assert math.isnan(chamfer(points, np.zeros((0, 3))))
    assert f_score(np.zeros((0, 3)), points) == 0.0


def test_f_score_counted_by_hand():
    true = np.array([[0.0, 0, 0], [0.1, 0, 0]])
    predicted = np.array([[0.005, 0, 0], [0.0, 0.005, 0], [5, 0, 0], [6, 0, 0]])
    # Precision 2/4, recall 1/2.
    assert f_score(predicted, true) == pytest.approx(0.5)
    assert f_score(true, true) == 1.0
    assert f_score(predicted + 9, true) == 0.0


def test_f_score_of_two_spheres_jumps_at_the_threshold():
    rng = np.random.default_rng(0)
    small, large = (
        sample_surface(trimesh.creation.icosphere(4, radius), 20000, rng) for radius in (0.1, 0.108)
    )
    assert f_score(small, large, threshold=0.01) > 0.99
    assert f_score(small, large, threshold=0.007) == 0.0


def test_samples_are_uniform_by_area():
    box = trimesh.creation.box((0.1, 0.1, 0.4))
    points = sample_surface(box, 20000, np.random.default_rng(0))
    # On the surface of a box the largest share of a half-extent is 1.
    np.testing.assert_allclose(np.abs(points / [0.05, 0.05, 0.2]).max(axis=1), 1, atol=1e-9)
    on_ends = np.mean(np.abs(np.abs(points[:, 2]) - 0.2) < 1e-9)
    assert on_ends == pytest.approx(2 / 18, abs=0.01)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=0.004)


def test_samples_repeat_with_the_seed_and_nothing_comes_from_nothing():
    box = trimesh.creation.box((1, 1, 1))
    first, second = (sample_surface(box, 50, np.random.default_rng(7)) for _ in range(2))
    assert first.tobytes() == second.tobytes()
    assert sample_surface(trimesh.Trimesh(), 50, np.random.default_rng(0)).shape == (0, 3)


@pytest.mark.parametrize("offset", [0.0, 50.0])
def test_inside_agrees_with_a_ball_far_from_the_origin_too(offset):
    ball = trimesh.creation.icosphere(5, 0.1)
    ball.apply_translation([offset] * 3)
    points = np.random.default_rng(0).uniform(-0.15, 0.15, (20000, 3))
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 0.1) > 2e-4
    np.testing.assert_array_equal(inside(ball, points + offset)[clear], (radius < 0.1)[clear])


def test_inside_of_no_points_is_empty():
    assert inside(trimesh.creation.box((1, 1, 1)), np.zeros((0, 3))).shape == (0,)


def test_inside_refuses_an_open_mesh():
    box = trimesh.creation.box((1, 1, 1))
    box.update_faces(np.arange(len(box.faces)) > 0)
    with pytest.raises(MeshError, match="open mesh"):
        inside(box, np.zeros((1, 3)))
    with pytest.raises(MeshError, match="open mesh"):
        inside(trimesh.Trimesh(), np.zeros((1, 3)))
