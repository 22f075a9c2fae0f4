"""A mean function on a grid: where the nodes are, what lies between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.inference.mean_grid import MeanGrid, grid_over

BOX = np.array([[-0.1, 0.2, 1.0], [0.1, 0.25, 1.4]])


def random_grid():
    values = np.random.default_rng(0).normal(size=(4, 5, 6)).astype(np.float16)
    return MeanGrid(np.array([0.3, -0.2, 1.0]), 0.01, values, outside=-5.0)


@pytest.mark.parametrize("nodes", [1000, 100_000])
def test_the_grid_covers_the_box_with_about_as_many_nodes_as_asked(nodes):
    lower, spacing, grid = grid_over(BOX, nodes)
    np.testing.assert_array_equal(lower, BOX[0])
    np.testing.assert_array_equal(grid[0, 0, 0], BOX[0])
    assert (grid[-1, -1, -1] >= BOX[1] - 1e-9).all()
    assert (grid[-1, -1, -1] < BOX[1] + spacing).all(), "no layer more than it takes"
    steps = [np.diff(grid[..., axis], axis=axis) for axis in range(3)]
    for step in steps:
        np.testing.assert_allclose(step, spacing, atol=1e-12)
    # The last layer of each axis is on top of what was asked.
    assert nodes <= grid[..., 0].size < nodes * np.prod(1 + 2 * spacing / (BOX[1] - BOX[0]))


def test_the_bounds_are_the_first_and_the_last_node():
    np.testing.assert_allclose(random_grid().bounds, [[0.3, -0.2, 1.0], [0.33, -0.16, 1.05]])


def test_at_the_nodes_the_logits_stand_as_they_are():
    grid = random_grid()
    index = np.array([[0, 0, 0], [3, 4, 5], [1, 2, 3], [2, 0, 5]])
    # The grid ends with its last nodes: rounding must not put these outside.
    within = np.clip(index, 1e-6, np.array([3, 4, 5]) - 1e-6)
    found = grid.logits(grid.lower + grid.spacing * within)
    np.testing.assert_allclose(found, grid.values[tuple(index.T)], atol=1e-5)
    assert found.shape == (4,) and found.dtype == np.float32


def test_between_the_nodes_a_trilinear_function_is_itself():
    grid = random_grid()

    def function(p):
        x, y, z = ((p - grid.lower) / grid.spacing).T
        return 1 + x - 2 * y + z + x * y * z / 8

    nodes = np.stack(np.meshgrid(*map(np.arange, (4, 5, 6)), indexing="ij"), axis=-1)
    values = function(grid.lower + grid.spacing * nodes.reshape(-1, 3)).reshape(4, 5, 6)
    exact = replace(grid, values=values.astype(np.float32))
    points = np.random.default_rng(1).uniform(*grid.bounds, (200, 3))
    np.testing.assert_allclose(exact.logits(points), function(points), atol=1e-4)


def test_off_the_grid_everything_is_the_outside():
    far = np.array([[0.0, 0, 0], [0.34, -0.18, 1.02], [0.31, -0.18, 0.9], [9, 9, 9]])
    np.testing.assert_array_equal(random_grid().logits(far), np.full(4, -5.0))


def test_the_volume_equals_the_points():
    grid = random_grid()
    axes = (np.linspace(0.28, 0.34, 5), np.linspace(-0.2, -0.15, 6), np.linspace(1.0, 1.05, 7))
    volume = grid.volume(axes)
    assert volume.shape == (5, 6, 7)
    for i, j, k in [(1, 2, 3), (4, 0, 6), (2, 5, 1)]:
        point = np.array([[axes[0][i], axes[1][j], axes[2][k]]])
        np.testing.assert_array_equal(volume[i, j, k], grid.logits(point)[0])
