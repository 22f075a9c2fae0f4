"""Hypotheses as means, corrected by samples: what each of them is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config import FittedMapConfig, MeanConfig
from brrp_cli.inference.infer_hypotheses import (
    Problem,
    box_grid,
    infer_correction,
    particles_of,
)
from brrp_cli.inference.mean_grid import MeanGrid, grid_over
from brrp_cli.observation.soft_samples import SoftSamples

WIDTH, LIMIT = 0.002, MeanConfig().limit
# Fewer hinge points than the preset has: the same code in a fraction of a second.
CONFIG = replace(FittedMapConfig(), hinges=300)
CENTER = np.array([0.1, -0.05, 0.8])
BOX = np.stack([CENTER - 0.08, CENTER + 0.08])
RADIUS = 0.05


def ball(points, radius=RADIUS):
    return np.linalg.norm(points - CENTER, axis=1) - radius


def larger(points):
    return ball(points, RADIUS + 0.008)


def empty(points):
    return np.full(len(points), 1.0)


def mean_of(distance):
    """The grid of a hypothesis that is quite sure of itself."""
    lower, spacing, nodes = grid_over(BOX, 20_000)
    values = np.clip(-distance(nodes.reshape(-1, 3)) / WIDTH, -LIMIT, LIMIT)
    return MeanGrid(lower, spacing, values.reshape(nodes.shape[:3]).astype(np.float16), -LIMIT)


def samples(points, targets):
    """None of them from a seen surface: all count."""
    return SoftSamples(points, np.asarray(targets, np.float64), np.full_like(points, np.nan))


NOTHING = samples(np.zeros((0, 3)), np.zeros(0))


def infer(observed, *distances, weights=None, stiffness=1.0, seed=0, config=CONFIG):
    weights = np.full(len(distances), 1 / len(distances)) if weights is None else weights
    means = tuple(mean_of(distance) for distance in distances)
    stiff = np.full(len(means), stiffness)
    problem = Problem(observed, means, np.array(weights), stiff, noise=0.005, box=BOX)
    return infer_correction(problem, config, seed=seed)


def around(count, seed=3):
    return np.random.default_rng(seed).uniform(*BOX, (count, 3))


@pytest.mark.parametrize(
    ("weights", "counts"),
    [
        ([1.0], [8]),
        ([0.5, 0.5], [4, 4]),
        ([0.75, 0.25], [6, 2]),
        ([0.125, 0.625, 0.25], [1, 5, 2]),
        ([0.99, 0.01], [7, 1]),
        ([0.01, 0.01, 0.98], [1, 1, 6]),
    ],
)
def test_particles_go_where_the_weight_is_and_everyone_has_one(weights, counts):
    which, shares = particles_of(np.array(weights), 8)
    np.testing.assert_array_equal(np.bincount(which), counts)
    np.testing.assert_allclose(shares, np.repeat(np.array(weights) / counts, counts))


def test_shares_sum_to_the_weights_whatever_the_number_of_particles():
    rng = np.random.default_rng(0)
    for _ in range(300):
        weights = rng.dirichlet(np.full(rng.integers(1, 13), 0.5)) + 1e-9
        weights /= weights.sum()
        particles = int(rng.integers(1, 20))
        which, shares = particles_of(weights, particles)
        assert len(which) == len(shares) == max(particles, len(weights))
        assert (np.diff(which) >= 0).all()
        np.testing.assert_array_equal(np.unique(which), np.arange(len(weights)))
        np.testing.assert_allclose(np.bincount(which, shares), weights, rtol=1e-12)
        # No particle weighs more than one of another hypothesis would, had it one less.
        counts = np.bincount(which)
        spare = counts > 1
        assert (shares.max() <= weights[spare] / (counts[spare] - 1) + 1e-12).all()


def test_more_hypotheses_than_particles_have_one_each():
    weights = np.full(12, 1 / 12)
    which, shares = particles_of(weights, 8)
    np.testing.assert_array_equal(which, np.arange(12))
    np.testing.assert_allclose(shares, weights)


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
    far = samples(around(50) + 5.0, np.ones(50))
    points = around(4000)
    for observed in (NOTHING, far):
        posterior = infer(observed, ball)
        prior = 1 / (1 + np.exp(-posterior.means[0].logits(points)))
        found = posterior.probability(points)
        decided = np.abs(ball(points)) > 0.01
        assert np.abs(found - prior)[decided].max() < 0.05
        np.testing.assert_array_equal((found > 0.5)[decided], (ball(points) < 0)[decided])


def test_the_posterior_ends_with_the_box():
    posterior = infer(NOTHING, ball)
    np.testing.assert_array_equal(posterior.bounds, BOX)
    assert posterior.probability(CENTER[None] + [[0, 0, 0.5]])[0] == 0


def test_samples_of_the_true_shape_mend_a_mean_that_is_too_large():
    points = around(3000)
    posterior = infer(samples(points, ball(points) < 0), larger)
    probes = around(20_000, seed=9)
    true = ball(probes) < 0

    def iou(occupied):
        return (occupied & true).sum() / (occupied | true).sum()

    grown = iou(posterior.means[0].logits(probes) > 0)
    assert grown < 0.7 and iou(posterior.probability(probes) > 0.5) > grown + 0.02


def test_a_stiffer_hypothesis_is_corrected_less():
    points = around(3000)
    observed = samples(points, ball(points) < 0)
    soft, stiff = (
        np.abs(infer(observed, larger, stiffness=s).correction.weights).mean() for s in (1.0, 50.0)
    )
    assert stiff < soft / 2


def test_occupied_samples_in_a_free_mean_raise_occupancy_and_free_ones_lower_it():
    spot = CENTER + np.random.default_rng(0).normal(0, 0.006, (200, 3))
    occupied = infer(samples(spot, np.ones(200)), empty)
    assert infer(NOTHING, empty).probability(CENTER[None])[0] < 0.05
    assert occupied.probability(CENTER[None])[0] > 0.5
    free = infer(samples(spot, np.zeros(200)), ball)
    assert infer(NOTHING, ball).probability(CENTER[None])[0] > 0.95
    assert free.probability(CENTER[None])[0] < 0.5


def test_samples_that_are_as_likely_in_as_out_draw_towards_that():
    spot = CENTER + np.random.default_rng(0).normal(0, 0.006, (200, 3))
    found = infer(samples(spot, np.full(200, 0.5)), empty).probability(CENTER[None])[0]
    sure = infer(samples(spot, np.ones(200)), empty).probability(CENTER[None])[0]
    assert found == pytest.approx(0.5, abs=0.15)
    assert sure > found + 0.2


def test_what_was_observed_of_one_side_leaves_the_mean_of_the_other():
    """The object is smaller than the hypothesis, and only its left half was seen."""
    points = around(4000)
    points = points[(points[:, 0] < CENTER[0]) & (ball(points) < 0)]
    posterior = infer(samples(points, ball(points, 0.02) < 0), ball)
    shell = CENTER + np.array([[-0.035, 0, 0], [0.035, 0, 0]])
    left, right = posterior.probability(shell)
    assert left < 0.5 < right


def test_each_hypothesis_counts_as_much_as_it_weighs():
    """Whatever the number of its particles: here two of eight for a tenth of the weight."""
    posterior = infer(NOTHING, ball, empty, weights=(0.9, 0.1))
    assert list(posterior.which) == [0] * 7 + [1]
    np.testing.assert_allclose(posterior.weights, [0.9, 0.1])
    assert posterior.probability(CENTER[None])[0] == pytest.approx(0.9, abs=0.02)
    assert posterior.uncertainty(CENTER[None])[0] == pytest.approx(0.9 * 0.1, abs=0.02)


def test_a_hypothesis_is_corrected_as_if_the_other_were_not_there():
    """Another mean for the second half of the particles leaves the first half as it was."""
    points = around(500)
    observed = samples(points, ball(points) < 0)
    beside_empty, beside_ball = (infer(observed, ball, other) for other in (empty, ball))
    assert list(beside_empty.which) == [0] * 4 + [1] * 4
    first, same = (p.correction.weights[:4] for p in (beside_empty, beside_ball))
    assert first.tobytes() == same.tobytes()
    second, other = (p.correction.weights[4:] for p in (beside_empty, beside_ball))
    assert second.tobytes() != other.tobytes()


def test_the_same_seed_gives_the_same_bytes_and_another_does_not():
    points = around(500)
    observed = samples(points, ball(points) < 0)
    first, again, other = (infer(observed, ball, seed=seed) for seed in (0, 0, 1))
    assert first.correction.weights.tobytes() == again.correction.weights.tobytes()
    assert first.correction.weights.tobytes() != other.correction.weights.tobytes()
