import numpy as np
import pytest

from brrp_cli.methods.vprism.kernel_features import KernelBasis, kernel_features


@pytest.fixture
def basis():
    rng = np.random.default_rng(0)
    return KernelBasis(hinges=rng.uniform(-0.3, 0.3, (120, 3)), gamma=1000.0, floor=1e-7)


@pytest.fixture
def points():
    return np.random.default_rng(1).uniform(-0.3, 0.3, (400, 3))


def dense(points, basis):
    squared = ((points[:, None] - basis.hinges[None]) ** 2).sum(axis=2)
    values = np.exp(-basis.gamma * squared)
    values[values < basis.floor] = 0.0
    return np.column_stack([values, np.ones(len(points))])


@pytest.mark.parametrize("cell", [0.02, 0.1, 1.0])
def test_products_equal_those_of_the_dense_matrix(basis, points, cell):
    rng = np.random.default_rng(2)
    phi = dense(points, basis)
    features = kernel_features(points, basis, cell)
    weights, vector = rng.random(len(points)), rng.normal(size=basis.size)
    matrix = rng.normal(size=(basis.size, basis.size))

    np.testing.assert_allclose(features.dot(vector), phi @ vector, atol=1e-12)
    np.testing.assert_allclose(features.transpose_dot(weights), weights @ phi, atol=1e-12)
    np.testing.assert_allclose(features.gram(weights), phi.T * weights @ phi, atol=1e-12)
    np.testing.assert_allclose(
        features.quadratic(matrix), np.einsum("ij,jk,ik->i", phi, matrix, phi), atol=1e-11
    )


def test_small_cubes_hold_a_small_share_of_the_columns(basis, points):
    features = kernel_features(points, basis, 0.05)
    held = sum(block.values.size for block in features.blocks)
    assert held < 0.3 * len(points) * basis.size


def test_reach_is_where_the_feature_meets_the_floor(basis):
    assert np.exp(-basis.gamma * basis.reach**2) == pytest.approx(basis.floor)


def test_a_point_gets_the_same_columns_alone_and_in_a_crowd(basis, points):
    crowd = kernel_features(points, basis, 0.05)
    alone = kernel_features(points[7:8], basis, 0.05).blocks[0]
    block = next(b for b in crowd.blocks if 7 in b.rows)
    np.testing.assert_array_equal(block.columns, alone.columns)
    np.testing.assert_array_equal(block.values[list(block.rows).index(7)], alone.values[0])


def test_no_points_give_empty_products(basis):
    features = kernel_features(np.empty((0, 3)), basis, 0.05)
    assert features.dot(np.ones(basis.size)).shape == (0,)
    assert not features.gram(np.empty(0)).any()
