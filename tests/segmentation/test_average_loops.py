"""Means over neighbours that differ by no more than noise."""

from __future__ import annotations

import numpy as np

from brrp_cli.segmentation.average_loops import averaged

RADIUS = 2


def by_definition(values, scale):
    """The mean by a Gaussian, pixel by pixel, of values (H + 4, W + 4)."""
    found = np.empty_like(scale, dtype=np.float64)
    for i, j in np.ndindex(scale.shape):
        window = values[i : i + 2 * RADIUS + 1, j : j + 2 * RADIUS + 1].astype(np.float64)
        weight = np.exp(-(((window - values[i + RADIUS, j + RADIUS]) * scale[i, j]) ** 2))
        found[i, j] = (weight * window).sum() / weight.sum()
    return found


def test_it_is_nearly_the_mean_by_a_gaussian():
    rng = np.random.default_rng(0)
    noise = 0.01
    values = (2 + rng.normal(scale=noise, size=(14, 16))).astype(np.float32)
    scale = rng.uniform(20, 90, (10, 12)).astype(np.float32)
    found = averaged(values, scale, RADIUS)
    np.testing.assert_allclose(found, by_definition(values, scale), rtol=0, atol=0.02 * noise)


def test_a_step_beyond_the_noise_stays_and_noise_on_either_side_does_not():
    rng = np.random.default_rng(0)
    step = np.repeat([1.0, 2.0], 20)[None].repeat(40, axis=0)
    noisy = (step + rng.normal(scale=0.01, size=step.shape)).astype(np.float32)
    inner = np.s_[RADIUS:-RADIUS, RADIUS:-RADIUS]
    found = averaged(noisy, np.full((36, 36), 20, np.float32), RADIUS)
    error = found - step[inner]
    assert np.abs(error).max() < 0.02
    assert error.std() < 0.3 * (noisy - step)[inner].std()
