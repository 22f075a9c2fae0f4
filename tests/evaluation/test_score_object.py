from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

from brrp_cli.evaluation.score_object import (
    isosurface,
    placement_error,
    reliability_sums,
    score_probabilities,
    score_shape,
)
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import similarity
from brrp_cli.ground_truth.true_meshes import ClosedMeshes, ExactMesh
from brrp_cli.ground_truth.true_shape import behind_seen, true_shape
from brrp_cli.reconstruction import Retrieved

RADIUS = 0.06
CENTER = np.array([0.03, -0.02, 0.8])
K = np.array([[100.0, 0, 50], [0, 100.0, 40], [0, 0, 1]])
# The camera stands somewhere else in the world and looks askew.
T_WORLD_CAM = similarity(
    1.0, trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3], [0.4, -0.3, 1.1]
)


@dataclass
class Ball:
    """Probability `inside` in a ball of this radius around CENTER, `outside` elsewhere."""

    radius: float
    inside: float = 1.0
    outside: float = 0.0
    bounds = np.array([CENTER - 0.2, CENTER + 0.2])

    def probability(self, points):
        near = np.linalg.norm(points - CENTER, axis=-1) < self.radius
        return np.where(near, self.inside, self.outside).astype(np.float32)

    def probability_volume(self, axes):
        return self.probability(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))

    def uncertainty(self, points):
        return np.ones(len(points), dtype=np.float32)


@pytest.fixture(scope="module")
def frame():
    """A wall at the depth of the ball's centre."""
    points = np.zeros((80, 100, 3), dtype=np.float32)
    points[..., 2] = CENTER[2]
    points[:, :10] = np.nan
    shape = points.shape[:2]
    rgb = np.zeros((*shape, 3), np.uint8)
    return Frame(rgb, points, np.ones(shape, np.int64), K, T_WORLD_CAM)


@pytest.fixture(scope="module")
def truth(frame):
    ball = trimesh.creation.icosphere(4, RADIUS).apply_translation(CENTER)
    thick = trimesh.creation.icosphere(4, RADIUS + 0.005).apply_translation(CENTER)
    exact = ExactMesh(ball, thickness=2 * RADIUS, pieces=1)
    meshes = ClosedMeshes(exact, for_iou=thick, for_chamfer=thick).moved(T_WORLD_CAM)
    return true_shape(meshes, frame, np.random.default_rng(0))


def score(posterior, truth):
    return score_shape(posterior, truth, np.random.default_rng(1))


def test_the_true_shape_scores_best(truth):
    found = score(Ball(RADIUS), truth)
    assert found["iou_exact"] > 0.95 and found["iou_5mm"] > 0.97
    assert found["f_score_1cm"] == pytest.approx(1.0, abs=0.01)
    # What an icosphere and sampling leave; marching cubes adds half a cell of 1.5 cm to it.
    assert found["chamfer_exact"] < 0.012
    # The published way thickens the truth by 5 mm: (60 / 65)^3.
    assert found["iou"] == pytest.approx((0.06 / 0.065) ** 3, abs=0.05)
    thick = score(Ball(RADIUS + 0.005), truth)
    assert thick["iou"] > 0.95 and thick["chamfer"] < found["chamfer"]


def test_iou_of_a_smaller_ball_is_the_ratio_of_volumes(truth):
    found = score(Ball(0.045), truth)
    assert found["iou_5mm"] == pytest.approx((0.045 / RADIUS) ** 3, abs=0.02)
    assert found["f_score_1cm"] < 0.01


def test_nothing_has_no_chamfer_distance(truth):
    found = score(Ball(0.0), truth)
    assert np.isnan(found["chamfer"]) and np.isnan(found["chamfer_exact"])
    assert found["iou"] == found["iou_5mm"] == found["f_score_1cm"] == 0.0


def test_probabilities_are_judged_on_all_points_and_on_those_behind(truth):
    scores, diagrams = score_probabilities(Ball(RADIUS, 0.8, 0.1), truth)
    share = truth.near_exact.mean()
    expected = share * 0.2**2 + (1 - share) * 0.1**2
    assert scores["brier_near"] == pytest.approx(expected, rel=0.02)
    nll = -share * np.log(0.8) - (1 - share) * np.log(0.9)
    assert scores["nll_near"] == pytest.approx(nll, rel=0.02)
    # The box is 12 cm along the world's axes, and grown by 5 cm on every side.
    reach = np.abs((truth.near - CENTER) @ T_WORLD_CAM[:3, :3].T).max(axis=0)
    assert (reach <= 0.11 + 1e-6).all() and (reach > 0.10).all()
    assert 0.4 < truth.occluded.mean() < 0.6
    count, probability, occupied = np.array(diagrams["occluded"])
    assert count.sum() == truth.occluded.sum()
    assert occupied.sum() == truth.near_exact[truth.occluded].sum()
    mean = probability[count > 0] / count[count > 0]
    assert mean == pytest.approx([0.1, 0.8])


def test_reliability_sums_add_up():
    rng = np.random.default_rng(3)
    p, y = rng.random(500), rng.random(500) < 0.4
    parts = np.array(reliability_sums(p[:200], y[:200])) + reliability_sums(p[200:], y[200:])
    np.testing.assert_allclose(parts, reliability_sums(p, y))
    np.testing.assert_allclose(parts.sum(axis=1), [500, p.sum(), y.sum()])


def test_behind_is_further_along_the_ray(frame):
    points = np.array(
        [
            [0, 0, 0.79],  # in front of the wall
            [0, 0, 0.81],  # behind it
            [-0.35, 0, 0.81],  # behind pixels without depth
            [2.0, 0, 0.81],  # outside of the image
            [0, 0, -1.0],  # behind the camera
        ]
    )
    assert behind_seen(points, frame).tolist() == [False, True, False, False, False]


def test_an_isosurface_lies_where_the_grid_says():
    axis = np.linspace(-1, 1, 41)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    volume = 1 / (1 + np.exp(20 * (np.sqrt(x**2 + y**2 + z**2) - 0.5)))
    mesh = isosurface(volume, similarity(0.05, translation=np.array([4.0, 5.0, 6.0]) - 1))
    assert np.linalg.norm(mesh.vertices - [4, 5, 6], axis=1) == pytest.approx(0.5, abs=0.01)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=0.02)
    assert isosurface(np.zeros((3, 3, 3)), np.eye(4)) is None
    assert isosurface(np.ones((3, 3, 3)), np.eye(4)) is None


def test_placement_error_is_the_distance_of_surfaces(truth):
    class Stored:
        surface = trimesh.creation.icosphere(3, 1.0).vertices.astype(np.float32)

    for radius in (RADIUS, RADIUS + 0.01):
        T = similarity(radius, translation=CENTER)
        found = placement_error(Retrieved("ball", 1.0, T_cam_object=T), Stored(), truth)
        assert found == pytest.approx(radius - RADIUS, abs=2e-4)
