import numpy as np
import torch

from brrp_cli.inference.hinge import (
    HingeGrid,
    axis_factors,
    cubic_grid,
    factors,
    features,
    grid_logits,
)

GRID = cubic_grid(per_axis=5, half_width=0.1, floor=1e-7)


def hinge_points():
    axis = np.linspace(-0.1, 0.1, 5)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def test_features_are_the_kernel_of_the_distance_to_every_hinge_point():
    points = np.random.default_rng(0).uniform(-0.15, 0.15, (50, 3))
    squared = ((points[:, None] - hinge_points()[None]) ** 2).sum(axis=-1)
    kernel = np.exp(-squared / 0.05**2)
    kernel[kernel < 1e-7] = 0
    expected = np.concatenate([np.ones((50, 1)), kernel], axis=1)
    found = features(torch.from_numpy(points), GRID).numpy()
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_far_from_every_hinge_point_only_the_bias_is_left():
    found = features(torch.tensor([[5.0, 0.0, 0.0]]), GRID)
    assert found[0, 0] == 1
    assert (found[0, 1:] == 0).all()


def test_spacing_is_that_of_the_papers_grid():
    assert cubic_grid(12, 0.15, 1e-7).spacing == 0.3 / 11
    assert cubic_grid(12, 0.15, 1e-7).dimension == 1729


def test_a_kernel_is_one_on_its_own_hinge_point():
    axis = torch.linspace(-0.1, 0.1, 5, dtype=torch.float64)
    np.testing.assert_allclose(torch.diagonal(axis_factors(axis, GRID, 0)), np.ones(5))


def test_grid_logits_equal_the_features_point_by_point_with_axes_in_order():
    generator = torch.Generator().manual_seed(0)
    weights = torch.randn(3, GRID.dimension, generator=generator, dtype=torch.float64)
    # Axes of three lengths: a swapped axis cannot go unseen.
    x, y, z = (torch.linspace(-0.12, 0.12, n, dtype=torch.float64) for n in (4, 6, 7))
    points = torch.stack(torch.meshgrid(x, y, z, indexing="ij"), dim=-1).reshape(-1, 3)
    expected = (weights @ features(points, GRID).T).reshape(3, 4, 6, 7)
    bound = GRID.floor * weights.abs().sum(dim=1).max()
    torch.testing.assert_close(
        grid_logits(weights, (x, y, z), GRID), expected, rtol=0, atol=float(bound)
    )


def test_a_box_of_hinge_points_keeps_its_axes_apart():
    grid = HingeGrid((-0.1, 0.0, 0.2), (2, 3, 4), 0.05, 1e-7)
    assert grid.dimension == 25
    i, j, k = 1, 2, 3
    hinge = torch.tensor([[-0.1 + 0.05 * i, 0.05 * j, 0.2 + 0.05 * k]], dtype=torch.float64)
    found = features(hinge, grid)[0, 1:]
    assert int(found.argmax()) == (i * 3 + j) * 4 + k
    np.testing.assert_allclose(float(found.max()), 1)


def test_a_kernel_under_the_floor_is_cut_before_it_is_multiplied():
    """And no feature changes: those that reach the floor have no factor under it."""
    grid = HingeGrid((0.0, 0.0, 0.0), (14, 13, 12), 0.02, 1e-7)
    points = torch.rand(200, 3, generator=torch.Generator().manual_seed(0)) * 0.3
    every = factors(points, grid)
    least = 1e-7
    assert every.first[every.first > 0].min() >= least
    assert every.rest[every.rest > 0].min() >= least**2
    assert (every.first == 0).any() and (every.rest == 0).any()
    steps = [0.02 * torch.arange(n) for n in grid.counts]
    x, y, z = (torch.exp(-(((points[:, i, None] - steps[i]) / 0.02) ** 2)) for i in range(3))
    product = (x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]).flatten(1)
    expected = torch.where(product < grid.floor, 0.0, product)
    assert torch.equal(features(points, grid)[:, 1:], expected)
