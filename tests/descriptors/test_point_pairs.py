import numpy as np
import trimesh

from brrp_cli.descriptors.point_pairs import MIN_POINTS, PAIR_BINS, pair_histogram


def half_ball(radius, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals[normals[:, 2] > 0]
    return radius * normals, normals


def plate(side):
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-side / 2, side / 2, (3000, 2)), np.zeros(3000)])
    return points, np.tile([0.0, 0, 1], (3000, 1))


def alike(one, two):
    return float(np.sqrt(one) @ np.sqrt(two))


def test_the_same_points_give_the_same_histogram():
    one, two = pair_histogram(*half_ball(0.05)), pair_histogram(*half_ball(0.05))
    np.testing.assert_array_equal(one, two)
    assert one.shape == (PAIR_BINS,) and abs(one.sum() - 1) < 1e-5


def test_pose_does_not_enter_and_size_and_shape_do():
    points, normals = half_ball(0.05)
    T = trimesh.transformations.rotation_matrix(0.9, [1, 2, 3], [0.1, 0, 0])
    here = pair_histogram(points, normals)
    moved = pair_histogram(points @ T[:3, :3].T + [0.4, 0.1, 0.9], normals @ T[:3, :3].T)
    assert alike(here, moved) > 0.995
    assert alike(here, pair_histogram(*half_ball(0.035))) < 0.97
    assert alike(here, pair_histogram(*plate(0.08))) < 0.8


def test_too_few_points_say_nothing():
    points, normals = half_ball(0.05)
    assert not pair_histogram(points[: MIN_POINTS - 1], normals[: MIN_POINTS - 1]).any()
    assert not pair_histogram(np.zeros((0, 3)), np.zeros((0, 3))).any()
