"""Grid subsampling."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from brrp_cli.observation import subsample
from brrp_cli.observation.subsample import dense_points, grid_subsample

CLOUDS = hnp.arrays(
    np.float64, st.tuples(st.integers(1, 60), st.just(3)), elements=st.floats(-0.5, 0.5)
)


def by_hand(points, cell):
    """The mean of each cell, one cell after the other."""
    cells = np.floor(points / cell)
    return np.array(
        [points[(cells == c).all(axis=1)].mean(axis=0) for c in np.unique(cells, axis=0)]
    )


@settings(deadline=None)
@given(points=CLOUDS, cell=st.sampled_from([0.01, 0.1, 2.0]))
def test_each_cell_gives_its_mean(points, cell):
    assert np.allclose(grid_subsample(points, cell), by_hand(points, cell), atol=1e-6)


@settings(deadline=None)
@given(points=CLOUDS, seed=st.integers(0, 99))
def test_order_does_not_matter(points, seed):
    shuffled = np.random.default_rng(seed).permutation(points)
    assert np.allclose(grid_subsample(shuffled, 0.1), grid_subsample(points, 0.1), atol=1e-6)


def test_far_outliers_give_the_same_means(monkeypatch):
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (500, 3))
    dense = grid_subsample(points, 0.05)
    monkeypatch.setattr(subsample, "_DENSE_CELLS", 1)
    assert np.array_equal(grid_subsample(points, 0.05), dense)
    far = np.concatenate([points, [[1e7, -1e7, 1e7]]])
    assert len(grid_subsample(far, 0.05)) == len(dense) + 1


def test_nothing_gives_nothing():
    assert grid_subsample(np.empty((0, 3)), 0.1).shape == (0, 3)


def test_float32_far_from_the_origin_keeps_its_millimetres():
    points = (np.array([[0.1, 0.2, 9.0]]) + np.zeros((100_000, 1))).astype(np.float32)
    assert np.allclose(grid_subsample(points, 0.05), points[:1], atol=1e-6)


def test_a_smear_behind_an_edge_is_left_out_and_the_surface_stays():
    rng = np.random.default_rng(0)
    wall = rng.uniform([0, 0, 0.5], [0.08, 0.06, 0.501], (5_000, 3))
    smear = rng.uniform([0.08, 0, 0.5], [0.083, 0.06, 0.7], (200, 3))
    kept = dense_points(np.concatenate([wall, smear]), 0.008, 0.2)
    assert (kept[:, 2] < 0.51).sum() > 0.97 * len(wall)
    assert (kept[:, 2] > 0.51).sum() == 0
    assert len(dense_points(np.zeros((0, 3)), 0.008, 0.2)) == 0
