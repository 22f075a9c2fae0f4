import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrp_cli.methods.pointsdf.farthest_points import farthest_points


def cloud(n=300, seed=0):
    return np.random.default_rng(seed).normal(size=(n, 3)).astype(np.float32)


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 60), st.integers(0, 1000))
def test_each_point_is_the_furthest_from_those_before_it(count, seed):
    points = cloud(80, seed)
    found = farthest_points(points, count)
    for i in range(1, count):
        gap = np.linalg.norm(points[:, None] - found[None, :i], axis=-1).min(axis=1)
        own = np.linalg.norm(found[i] - found[:i], axis=-1).min()
        assert own == pytest.approx(gap.max(), rel=1e-5)


def test_a_leading_part_is_the_order_of_its_length():
    np.testing.assert_array_equal(farthest_points(cloud(), 256)[:36], farthest_points(cloud(), 36))


def test_the_order_of_the_pixels_does_not_matter():
    points = cloud()
    shuffled = np.random.default_rng(1).permutation(points)
    np.testing.assert_array_equal(farthest_points(points, 64), farthest_points(shuffled, 64))


def test_a_small_cloud_is_repeated_from_its_beginning():
    found = farthest_points(cloud(5), 12)
    np.testing.assert_array_equal(found[5:10], found[:5])
    assert len(np.unique(found, axis=0)) == 5


def test_one_point_is_a_cloud():
    np.testing.assert_array_equal(farthest_points(np.ones((1, 3)), 4), np.ones((4, 3)))
