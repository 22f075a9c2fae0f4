"""A posterior over hypotheses: its uncertainty in metres, its grid, its file."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest
from brrp_cli.inference.prior_mean import PriorMeanGrid

from brrp_cli.errors import BrrpError
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.hypothesis_posterior import LARGEST, HypothesisPosterior
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.methods.posterior_file import open_posterior
from brrp_cli.results.posterior_file import save_posteriors

CENTER = np.array([0.1, -0.2, 0.9])
GRID = HingeGrid((-0.05, -0.05, -0.05), (3, 3, 3), 0.05, 1e-7)
SPACING = 0.0025


def posterior(*functions, which=(0,), weights=0.0):
    """Hypotheses with logits that are functions of x (n,), metres from the centre."""
    x = np.arange(-0.06, 0.0601, SPACING)
    values = np.stack([np.broadcast_to(f(x)[:, None, None], (len(x), 9, 9)) for f in functions])
    lower = CENTER + [-0.06, -4 * SPACING, -4 * SPACING]
    mean = PriorMeanGrid(lower, SPACING, values.astype(np.float16), outside=-5.0)
    particles = np.random.default_rng(0).normal(0, 1, (len(which), GRID.dimension)) * weights
    correction = HilbertPosterior(particles.astype(np.float32), CENTER, GRID, 0.06)
    return HypothesisPosterior(mean, np.array(which), correction)


def ramp(width, place=0.0):
    """Occupied where x is less than `place`."""
    return lambda x: (place - x) / width


def mixed():
    """Two hypotheses, three particles, each with weights of its own."""
    return posterior(ramp(0.02), ramp(0.02, 0.01), which=(0, 1, 1), weights=0.5)


@pytest.mark.parametrize("width", [0.002, 0.005, 0.01])
def test_the_spread_of_a_logistic_surface_is_that_of_its_distribution(width):
    """sigmoid(-x / s) is a logistic distribution of the surface's place: pi s / sqrt(3)."""
    found = posterior(ramp(width)).surface_uncertainty(CENTER[None])
    # Between nodes 2.5 mm apart, difference quotients over 2 mm are a little too flat.
    assert found[0] == pytest.approx(np.pi * width / np.sqrt(3), rel=0.05)
    assert found.dtype == np.float32


def test_the_spread_does_not_depend_on_which_way_the_surface_faces():
    along_x = posterior(ramp(0.005))
    turned = replace(along_x, mean=replace(along_x.mean, values=along_x.mean.values[:, ::-1]))
    middle = along_x.mean.lower + (along_x.mean.upper - along_x.mean.lower) / 2
    np.testing.assert_allclose(
        along_x.surface_uncertainty(middle[None]), turned.surface_uncertainty(middle[None])
    )


def test_two_hypotheses_apart_are_less_certain_than_one():
    one = posterior(ramp(0.003), which=(0, 0))
    two = posterior(ramp(0.003, -0.01), ramp(0.003, 0.01), which=(0, 1))
    middle = CENTER[None]
    assert one.probability(middle)[0] == pytest.approx(0.5, abs=0.01)
    assert two.probability(middle)[0] == pytest.approx(0.5, abs=0.01)
    assert two.surface_uncertainty(middle)[0] > 2 * one.surface_uncertainty(middle)[0]
    assert two.uncertainty(middle)[0] > 0.2


def test_where_nothing_says_where_the_surface_is_the_spread_is_the_largest():
    flat = posterior(lambda x: np.zeros_like(x))
    assert flat.surface_uncertainty(CENTER[None])[0] == pytest.approx(LARGEST)


def test_probability_is_the_mean_over_particles_of_mean_and_correction():
    two = mixed()
    points = CENTER + np.random.default_rng(1).uniform(-0.008, 0.008, (20, 3))
    logits = two.mean.logits(points)[[0, 1, 1]] + two.correction.logits(points)
    np.testing.assert_allclose(two.logits(points), logits)
    expected = (1 / (1 + np.exp(-logits.astype(np.float64)))).mean(axis=0)
    np.testing.assert_allclose(two.probability(points), expected, atol=1e-6)
    np.testing.assert_allclose(two.uncertainty(points), expected * (1 - expected), atol=1e-6)


def test_the_volume_equals_the_points():
    two = mixed()
    axes = tuple(np.linspace(-0.008, 0.009, n) + c for n, c in zip((3, 4, 5), CENTER, strict=True))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(
        two.probability_volume(axes).ravel(), two.probability(points), atol=1e-5
    )


def test_the_file_gives_the_same_probabilities_and_the_same_bytes(tmp_path):
    two = mixed()
    plain = two.correction
    save_posteriors({7: two, -3: plain}, tmp_path / "a.h5")
    save_posteriors({7: two, -3: plain}, tmp_path / "b.h5")
    found = open_posterior(tmp_path / "a.h5")
    points = CENTER + np.random.default_rng(1).uniform(-0.08, 0.08, (200, 3))
    np.testing.assert_array_equal(found[7].probability(points), two.probability(points))
    np.testing.assert_array_equal(
        found[7].surface_uncertainty(points), two.surface_uncertainty(points)
    )
    np.testing.assert_array_equal(found[7].bounds, two.bounds)
    np.testing.assert_array_equal(found[-3].probability(points), plain.probability(points))
    assert isinstance(found[7], HypothesisPosterior)
    assert isinstance(found[-3], HilbertPosterior)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def without_which(path):
    with h5py.File(path, "r+") as file:
        del file["objects/7/which"]


def cut(path):
    path.write_bytes(path.read_bytes()[:-300])


def flipped(path):
    """One bit of the mean's compressed bytes."""
    with h5py.File(path) as file:
        place = file["objects/7/mean"].id.get_chunk_info(0).byte_offset + 20
    data = bytearray(path.read_bytes())
    data[place] ^= 4
    path.write_bytes(data)


@pytest.mark.parametrize("damage", [without_which, cut, flipped])
def test_a_damaged_file_is_refused(tmp_path, damage):
    path = tmp_path / "posterior.h5"
    save_posteriors({7: mixed()}, path)
    damage(path)
    with pytest.raises(BrrpError, match="cannot be read") as caught:
        open_posterior(path)
    assert "brrp reconstruct" in str(caught.value)
