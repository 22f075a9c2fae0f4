from dataclasses import replace

import numpy as np
import pytest
import torch
from eight_objects import MESHES, NETWORK

from brrp_cli.config import PointSDFConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.ground_truth.truth import true_mesh_in_camera
from brrp_cli.methods.pointsdf.method import (
    LOGISTIC_DEVIATION,
    PointSDFPosterior,
    reconstruct_pointsdf,
)
from brrp_cli.methods.pointsdf.network import PointSDF
from brrp_cli.methods.pointsdf.weights import load_weights
from brrp_cli.methods.posterior_file import open_posterior
from brrp_cli.raycast import inside
from brrp_cli.reconstruction import METRES
from brrp_cli.results.posterior_file import save_posteriors
from brrp_cli.surface.extract import extract_surface, grid_axes

CENTER = np.array([0.1, -0.2, 0.8])
RADIUS, WIDTH = 0.06, 0.004


class Ball(torch.nn.Module):
    """A decoder whose answer is known: a ball whose logit falls by 1 in each `WIDTH` metres."""

    def __init__(self):
        super().__init__()
        self.unused = torch.nn.Parameter(torch.zeros(1))

    def forward(self, codes, queries):
        return (RADIUS - queries.norm(dim=-1) * 0.15) / WIDTH


@pytest.fixture
def ball():
    return PointSDFPosterior(Ball(), np.zeros(4, np.float32), CENTER, 0.15, PointSDFConfig())


def on_ball(radius, n=500):
    direction = np.random.default_rng(0).normal(size=(n, 3))
    return CENTER + radius * direction / np.linalg.norm(direction, axis=1, keepdims=True)


def test_queries_are_centred_and_scaled(ball):
    np.testing.assert_allclose(ball.logits(on_ball(0.05)), (RADIUS - 0.05) / WIDTH, atol=1e-3)
    np.testing.assert_allclose(ball.probability(on_ball(RADIUS)), 0.5, atol=1e-3)


def test_nothing_is_occupied_outside_of_the_box(ball):
    everything = replace(ball, config=PointSDFConfig(half_width=0.03))
    corner = CENTER + [0.029, 0.029, 0.029]
    assert everything.probability(np.array([corner]))[0] > 0.9
    assert everything.probability(np.array([corner + [0.002, 0, 0]]))[0] == 0


def test_a_lattice_is_that_of_its_points_where_it_counts(ball):
    axes = grid_axes(ball.bounds, 0.005)
    volume = ball.probability_volume(axes)
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    exact = ball.probability(nodes.reshape(-1, 3)).reshape(volume.shape)
    likely = exact > 0.02
    np.testing.assert_allclose(volume[likely], exact[likely], atol=1e-6)
    assert (volume[~likely] < 0.05).all()
    assert ((volume > 0.3) == (exact > 0.3)).all()


def test_odd_lattices_are_filled_to_their_ends(ball):
    axes = tuple(np.arange(n) * 0.004 + CENTER[d] - 0.03 for d, n in enumerate((4, 5, 6)))
    volume = ball.probability_volume(axes)
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    np.testing.assert_allclose(volume.ravel(), ball.probability(nodes.reshape(-1, 3)), atol=1e-6)


def test_the_surface_lies_where_occupancy_is_the_papers(ball):
    config = PointSDFConfig().surface
    assert config.level == 0.3
    surface = extract_surface(ball, on_ball(RADIUS), config)
    radius = np.linalg.norm(surface.vertices - CENTER, axis=1)
    # logit(0.3) = -0.847
    np.testing.assert_allclose(radius, RADIUS + WIDTH * np.log(0.7 / 0.3), atol=1e-3)
    assert surface.as_trimesh().is_volume


def test_uncertainty_of_the_surface_is_its_spread(ball):
    assert ball.surface_unit == METRES
    found = ball.surface_uncertainty(on_ball(RADIUS))
    np.testing.assert_allclose(found, LOGISTIC_DEVIATION * WIDTH, rtol=0.02)
    assert pytest.approx(0.0073, abs=1e-4) == LOGISTIC_DEVIATION * WIDTH
    flat = replace(ball, scale=1e6)
    np.testing.assert_allclose(flat.surface_uncertainty(on_ball(RADIUS)), 0.05)
    np.testing.assert_allclose(ball.uncertainty(on_ball(RADIUS)), 0.25, atol=1e-3)


@pytest.mark.slow
def test_objects_learnt_by_heart_are_reconstructed(learnt):
    """Through the method: the frame's own clouds, against the true meshes on a fresh grid."""
    scene = learnt.scenes[0]
    frame = scene.view(0)
    found = reconstruct_pointsdf(frame, load_weights(learnt.weights).network, PointSDFConfig())
    assert [item.object_id for item in found] == list(range(1, 9))
    ious = []
    for item in found:
        mesh = true_mesh_in_camera(scene.object(item.object_id), learnt.folder, frame.T_world_cam)
        low, high = mesh.bounds
        points = np.random.default_rng(0).uniform(low - 0.05, high + 0.05, (4000, 3))
        one, other = item.posterior.probability(points) > 0.3, inside(mesh, points)
        ious.append((one & other).sum() / (one | other).sum())
    assert np.mean(ious) > 0.85, dict(zip(MESHES, ious, strict=True))


def test_one_object_is_answered_as_among_others(trained):
    """All clouds are encoded together, and none changes another's answer."""
    frame = trained.scenes[0].view(0)
    network = load_weights(trained.weights).network
    alone = replace(frame, segmap=np.where(frame.segmap == 4, 4, 0))
    (one,) = reconstruct_pointsdf(alone, network, PointSDFConfig())
    among = reconstruct_pointsdf(frame, network, PointSDFConfig())[3]
    points = one.center + np.random.default_rng(0).uniform(-0.1, 0.1, (500, 3))
    np.testing.assert_allclose(
        one.posterior.probability(points), among.posterior.probability(points), atol=1e-4
    )


def test_objects_with_too_few_points_say_so(trained):
    frame = trained.scenes[0].view(0)
    segmap = np.zeros_like(frame.segmap)
    rows, columns = np.nonzero(frame.segmap == 4)
    segmap[rows[:5], columns[:5]] = 9
    network = PointSDF(NETWORK).eval()
    few = replace(frame, segmap=segmap)
    (item,) = reconstruct_pointsdf(few, network, PointSDFConfig())
    assert item.status == "too_few_points" and item.posterior is None
    assert "5 valid depth points" in item.message
    nothing = Frame(frame.rgb, frame.points, np.zeros_like(segmap), frame.K)
    assert reconstruct_pointsdf(nothing, network, PointSDFConfig()) == []


def test_a_kept_posterior_answers_without_the_weights(trained, tmp_path):
    frame = trained.scenes[0].view(0)
    found = reconstruct_pointsdf(frame, load_weights(trained.weights).network, PointSDFConfig())
    path = tmp_path / "posterior.h5"
    save_posteriors({item.object_id: item.posterior for item in found}, path)
    kept = open_posterior(path)
    assert set(kept) == set(range(1, 9))
    for item in found:
        points = item.center + np.random.default_rng(0).uniform(-0.3, 0.3, (300, 3))
        np.testing.assert_array_equal(
            kept[item.object_id].probability(points), item.posterior.probability(points)
        )
