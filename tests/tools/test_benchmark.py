"""The plain implementation says the same as brrp, and the benchmark runs and keeps its numbers."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from benchmark import main
from click.testing import CliRunner
from plain.density import dense_features, gradient, hinge_points, log_posterior, mean_bce
from plain.svgd import stein_direction as plain_direction
from speed.frames import with_objects, with_pixels
from speed.sets import frames_of
from table_scene import box, in_camera, photograph, placed

from brrp_cli.errors import SceneError
from brrp_cli.frames.npz import save_frame
from brrp_cli.inference.density import Lambdas, Samples, log_density, logistic_score
from brrp_cli.inference.hinge import HingeGrid, cubic_grid, factors, features
from brrp_cli.inference.svgd import stein_direction
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import BuildParameters

PER_AXIS, HALF_WIDTH, FLOOR = 5, 0.15, 1e-7
LAMBDAS = (50.0, 1.0, 1e-6)


@pytest.fixture
def generator():
    return torch.Generator().manual_seed(0)


def drawn(count, generator):
    """Points in the map's cube, a little beyond it, and labels."""
    points = (torch.rand(count, 3, generator=generator) - 0.5) * 0.34
    return points, (torch.rand(count, generator=generator) < 0.4).float()


def both_features(points):
    """Plainly, and brrp's."""
    hinges, width = hinge_points(PER_AXIS, HALF_WIDTH)
    plain = dense_features(points, hinges, width, FLOOR)
    return plain, features(points, cubic_grid(PER_AXIS, HALF_WIDTH, FLOOR))


def test_features_are_the_same(generator):
    plain, ours = both_features(drawn(200, generator)[0])
    torch.testing.assert_close(ours, plain, atol=1e-6, rtol=0)
    assert (plain[:, 1:] == 0).any() and (plain[:, 1:] > 0.5).any()


def test_objective_and_gradient_of_the_paper_are_the_same(generator):
    weights = torch.randn(4, PER_AXIS**3 + 1, generator=generator).requires_grad_(True)
    samples = [drawn(count, generator) for count in (300, 50, 50)]
    phi = [both_features(points) for points, _ in samples]
    probabilities = torch.tensor([0.7, 0.1])
    plain = log_posterior(
        weights,
        (phi[0][0], samples[0][1]),
        [(phi[i][0], samples[i][1]) for i in (1, 2)],
        probabilities,
        LAMBDAS,
    )
    value, score = log_density(
        weights.detach(),
        Samples(phi[0][1], samples[0][1]),
        Samples(torch.stack([phi[1][1], phi[2][1]]), torch.stack([samples[1][1], samples[2][1]])),
        probabilities.log(),
        Lambdas(*LAMBDAS),
    )
    torch.testing.assert_close(value, plain.detach(), rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(score, gradient(plain, weights), rtol=1e-5, atol=1e-5)


def test_gradient_of_the_default_is_that_of_autograd(generator):
    """Factors of the kernels in place of features, and a mean of each particle's own."""
    grid = HingeGrid((-0.1, -0.1, -0.1), (5, 4, 6), 0.05, FLOOR)
    points, labels = drawn(300, generator)
    weights = torch.randn(4, grid.dimension, generator=generator)
    weights[:, 0] = 0
    weights.requires_grad_(True)
    mean = torch.randn(4, 300, generator=generator)
    axes = [
        torch.tensor(low) + 0.05 * torch.arange(n)
        for low, n in zip(grid.lower, grid.counts, strict=True)
    ]
    hinges = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3)
    phi = dense_features(points, hinges, grid.spacing, FLOOR)
    logits = mean + weights @ phi.T
    loss = torch.nn.functional.binary_cross_entropy_with_logits(
        logits, labels.expand_as(logits), reduction="none"
    ).mean(dim=1)
    expected = gradient(loss, weights)
    expected[:, 0] = 0
    found = logistic_score(
        weights.detach(), factors(points, grid), labels, mean, torch.ones_like(mean)
    )
    torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-5)


def test_stein_directions_are_the_same(generator):
    particles, scores = (torch.randn(8, 50, generator=generator) for _ in range(2))
    expected = plain_direction(particles, scores)
    torch.testing.assert_close(stein_direction(particles, scores), expected, rtol=1e-4, atol=1e-5)


def test_the_loss_of_sure_and_right_weights_is_small(generator):
    phi = torch.ones(10, 1)
    labels = torch.ones(10)
    losses = mean_bce(torch.tensor([[10.0], [-10.0]]), phi, labels)
    assert losses[0] < 1e-4 and losses[1] == pytest.approx(10, abs=1e-3)


@pytest.fixture(scope="module")
def frame():
    mesh = box()
    poses = {1: placed(-0.1, 0.0, 0.7), 2: placed(0.1, 0.02, 0.1)}
    return photograph({i: in_camera(mesh, pose) for i, pose in poses.items()})


def test_frames_grow_in_one_thing_only(frame):
    assert with_objects(frame, 1).object_ids == [1]
    double = with_pixels(frame, 2)
    assert double.shape == tuple(2 * n for n in frame.shape)
    centers = [np.nanmedian(f.object_points(1), axis=0) for f in (frame, double)]
    np.testing.assert_allclose(*centers, atol=0.002)


def test_a_set_is_the_frames_of_a_folder(frame, tmp_path):
    for name in "cab":
        save_frame(with_objects(frame, 1 + (name == "a")), tmp_path / f"{name}.npz")
    assert [len(each.object_ids) for each in frames_of(tmp_path, 2)] == [2, 1]
    assert frames_of(tmp_path, 1, masks=False)[0].object_ids == []
    (tmp_path / "none").mkdir()
    with pytest.raises(SceneError, match="none"):
        frames_of(tmp_path / "none", 2)


@pytest.mark.slow
def test_the_benchmark_keeps_what_it_measured(frame, tmp_path):
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    box().export(meshes / "box.ply")
    prior = tmp_path / "prior"
    build_prior(meshes, prior, BuildParameters(samples=500, dense_points=5000), workers=1)
    save_frame(with_objects(frame, 1), tmp_path / "frame.npz")
    history = tmp_path / "history.jsonl"
    options = ["--no-made", "--repeats", "2", "--plain-objects", "0", "--no-cold", "--workers", "1"]
    options += ["--set", f"mine={tmp_path}"]
    result = CliRunner().invoke(
        main,
        [str(tmp_path / "frame.npz"), "--prior", str(prior), "--json", str(history), *options],
        catch_exceptions=False,
    )
    assert result.exit_code == 0, result.output
    assert "registration" in result.output and "GFLOP/s" in result.output
    (line,) = history.read_text().splitlines()
    record = json.loads(line)
    assert record["frames"][0]["denormals"] == {} and "denormal numbers: none" in result.output
    assert record["machine"]["flops"] > 0 and record["peak_megabytes"] > 0
    (row,) = record["sets"]
    assert row["frames"] == row["objects"] == row["known"] == 1 and row["plain"] is None
    assert 0 < row["an_object"] == row["a_frame"] and row["busy"] > 0
    (found,) = record["frames"]
    assert found["objects"] == 1 and set(found["limits"]) <= set(found["stages"])
    for each in [*found["stages"].values(), *found["whole"].values()]:
        assert 0 <= each["least"] <= each["median"] <= each["most"] and each["count"] == 2
    whole = found["whole"]["1 thread"]["most"]
    assert sum(s["least"] for s in found["stages"].values()) <= whole
