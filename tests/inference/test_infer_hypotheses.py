"""Hypotheses as means, corrected by samples: what each of them is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from brrp_cli.inference.prior_mean import PriorMeanGrid, grid_over, shape_logits

from brrp_cli.config import FittedMapConfig, MeanConfig
from brrp_cli.inference.infer import LabelledPoints
from brrp_cli.inference.infer_hypotheses import (
    Problem,
    box_grid,
    infer_correction,
    systematic_resampling,
)

MEAN = replace(MeanConfig(), nodes=20_000)
# Fewer hinge points than the preset has: the same code in a fraction of a second.
CONFIG = replace(FittedMapConfig(), hinges=300)
CENTER = np.array([0.1, -0.05, 0.8])
BOX = np.stack([CENTER - 0.08, CENTER + 0.08])
RADIUS = 0.05
NOTHING = LabelledPoints(np.zeros((0, 3)), np.zeros(0, bool))


def ball(points, radius=RADIUS):
    return np.linalg.norm(points - CENTER, axis=1) - radius


def empty(points):
    return np.full(len(points), 1.0)


def mean_of(*distances):
    """The grid of hypotheses that are quite sure of themselves."""
    lower, spacing, nodes = grid_over(BOX, MEAN)
    flat = nodes.reshape(-1, 3)
    values = np.stack([shape_logits(distance(flat), 1.0, MEAN) for distance in distances])
    return PriorMeanGrid(
        lower, spacing, values.reshape(-1, *nodes.shape[:3]).astype(np.float16), -MEAN.limit
    )


def infer(observed, *distances, weights=None, seed=0, config=CONFIG):
    weights = np.full(len(distances), 1 / len(distances)) if weights is None else weights
    which = systematic_resampling(weights, config.particles)
    return infer_correction(Problem(observed, mean_of(*distances), which, BOX), config, seed=seed)


def around(count, seed=3):
    return np.random.default_rng(seed).uniform(*BOX, (count, 3))


@pytest.mark.parametrize(
    ("weights", "counts"),
    [
        ([1.0], [8]),
        ([0.5, 0.5], [4, 4]),
        ([0.0, 1.0], [0, 8]),
        ([0.75, 0.25], [6, 2]),
        ([0.125, 0.625, 0.25], [1, 5, 2]),
        ([0.99, 0.01], [8, 0]),
    ],
)
def test_particles_are_shared_out_as_the_weights_say(weights, counts):
    found = systematic_resampling(np.array(weights), 8)
    np.testing.assert_array_equal(np.bincount(found, minlength=len(weights)), counts)


def test_every_hypothesis_gets_its_share_rounded_up_or_down():
    rng = np.random.default_rng(0)
    for _ in range(300):
        weights = rng.dirichlet(np.full(rng.integers(1, 9), 0.5))
        particles = int(rng.integers(1, 20))
        found = systematic_resampling(weights, particles)
        counts = np.bincount(found, minlength=len(weights))
        assert len(found) == particles and (np.diff(found) >= 0).all()
        assert (counts >= np.floor(weights * particles - 1e-9)).all()
        assert (counts <= np.ceil(weights * particles + 1e-9)).all()


def test_weights_that_miss_one_by_rounding_give_no_hypothesis_that_is_not_there():
    assert systematic_resampling(np.array([0.3, 0.6]), 8).max() == 1


@pytest.mark.parametrize("extents", [(0.2, 0.2, 0.2), (0.4, 0.1, 0.15), (0.3, 0.3, 0.06)])
def test_hinges_cover_the_box_about_as_many_as_asked(extents):
    box = np.stack([-np.array(extents), np.array(extents)]) / 2 + [0.1, 0.2, 0.3]
    grid = box_grid(box, CONFIG)
    lower = np.array(grid.lower)
    upper = lower + grid.spacing * (np.array(grid.counts) - 1)
    assert (lower <= box[0] + 1e-9).all() and (upper >= box[1] - 1e-9).all()
    assert (upper - box[1] < grid.spacing).all()
    np.testing.assert_allclose(lower + upper, box[0] + box[1], atol=1e-9)
    number = np.prod(grid.counts)
    assert (
        CONFIG.hinges <= number < CONFIG.hinges * np.prod(1 + 2 * grid.spacing / np.array(extents))
    )
    assert grid.dimension == number + 1


def test_hinges_are_never_closer_than_the_least_spacing():
    tiny = np.array([[0.0, 0, 0], [0.05, 0.03, 0.02]])
    grid = box_grid(tiny, CONFIG)
    assert grid.spacing == CONFIG.least_spacing
    assert grid.counts == (6, 4, 3)


def test_without_samples_in_reach_the_posterior_is_the_mean():
    """Particles start at random and are drawn to 0: what is left is no more than that start."""
    far = LabelledPoints(around(50) + 5.0, np.ones(50, bool))
    points = around(4000)
    for observed in (NOTHING, far):
        posterior = infer(observed, ball, config=CONFIG)
        prior = 1 / (1 + np.exp(-posterior.mean.logits(points)[0]))
        found = posterior.probability(points)
        decided = np.abs(ball(points)) > 0.01
        assert np.abs(found - prior)[decided].max() < 0.05
        np.testing.assert_array_equal((found > 0.5)[decided], (ball(points) < 0)[decided])


def test_off_the_lattice_nothing_is_occupied():
    posterior = infer(NOTHING, ball)
    np.testing.assert_allclose(posterior.bounds, BOX, atol=posterior.mean.spacing)
    assert posterior.probability(CENTER[None] + [[0, 0, 0.5]])[0] < 0.01


def test_samples_of_the_true_shape_mend_what_the_mean_has_grown():
    points = around(3000)
    exact = replace(CONFIG, behind=0.0)
    posterior = infer(LabelledPoints(points, ball(points) < 0), ball, config=exact)
    probes = around(20_000, seed=9)
    true = ball(probes) < 0

    def iou(occupied):
        return (occupied & true).sum() / (occupied | true).sum()

    grown = iou(posterior.mean.logits(probes)[0] > 0)
    assert iou(posterior.probability(probes) > 0.5) > grown > 0.9


def test_occupied_samples_in_a_free_mean_raise_occupancy_and_free_ones_lower_it():
    spot = CENTER + np.random.default_rng(0).normal(0, 0.006, (200, 3))
    occupied = infer(LabelledPoints(spot, np.ones(200, bool)), empty)
    assert infer(NOTHING, empty).probability(CENTER[None])[0] < 0.05
    assert occupied.probability(CENTER[None])[0] > 0.5
    free = infer(LabelledPoints(spot, np.zeros(200, bool)), ball)
    assert infer(NOTHING, ball).probability(CENTER[None])[0] > 0.95
    assert free.probability(CENTER[None])[0] < 0.5


def test_what_was_observed_of_one_side_leaves_the_mean_of_the_other():
    """The object is smaller than the hypothesis, and only its left half was seen."""
    points = around(4000)
    points = points[(points[:, 0] < CENTER[0]) & (ball(points) < 0)]
    posterior = infer(
        LabelledPoints(points, ball(points, 0.02) < 0), ball, config=replace(CONFIG, behind=0)
    )
    shell = CENTER + np.array([[-0.035, 0, 0], [0.035, 0, 0]])
    left, right = posterior.probability(shell)
    assert left < 0.5 < right


def test_surface_points_are_taken_from_behind_the_surface():
    """A wall at z = 0.8 is occupied behind it; before it, it is as free as the rays say."""
    flat = np.random.default_rng(0).uniform(-0.06, 0.06, (800, 3)) * [1, 1, 0] + CENTER
    free = flat - np.random.default_rng(1).uniform(0.004, 0.07, (800, 1)) * [0, 0, 1]
    observed = LabelledPoints(
        np.concatenate([flat, free]), np.repeat([True, False], [len(flat), len(free)])
    )
    axis = CENTER + np.linspace(-0.03, 0.02, 101)[:, None] * [0, 0, 1]
    crossing = []
    for behind in (0.0, 0.008):
        posterior = infer(observed, empty, config=replace(CONFIG, behind=behind, steps=100))
        crossing.append(axis[np.argmax(posterior.probability(axis) > 0.5), 2])
    assert 0.002 < crossing[1] - crossing[0] < 0.014


def test_each_particle_has_the_mean_of_its_hypothesis():
    posterior = infer(NOTHING, ball, empty, weights=np.array([0.75, 0.25]))
    assert list(posterior.which) == [0] * 6 + [1] * 2
    assert posterior.probability(CENTER[None])[0] == pytest.approx(0.75, abs=0.02)
    assert posterior.uncertainty(CENTER[None])[0] == pytest.approx(0.75 * 0.25, abs=0.02)


def test_a_hypothesis_is_corrected_as_if_the_other_were_not_there():
    """Another mean for the second half of the particles leaves the first half as it was."""
    points = around(500)
    observed = LabelledPoints(points, ball(points) < 0)
    beside_empty, beside_ball = (infer(observed, ball, other) for other in (empty, ball))
    assert list(beside_empty.which) == [0] * 4 + [1] * 4
    first, same = (p.correction.weights[:4] for p in (beside_empty, beside_ball))
    assert first.tobytes() == same.tobytes()
    second, other = (p.correction.weights[4:] for p in (beside_empty, beside_ball))
    assert second.tobytes() != other.tobytes()


def test_the_same_seed_gives_the_same_bytes_and_another_does_not():
    points = around(500)
    observed = LabelledPoints(points, ball(points) < 0)
    first, again, other = (infer(observed, ball, seed=seed) for seed in (0, 0, 1))
    assert first.correction.weights.tobytes() == again.correction.weights.tobytes()
    assert first.correction.weights.tobytes() != other.correction.weights.tobytes()
