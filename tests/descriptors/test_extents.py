import numpy as np
import pytest

from brrp_cli.descriptors.extents import footprint, standing_size


def block(a, b, h, angle):
    rng = np.random.default_rng(0)
    corners = np.array([[x, y] for x in (-a / 2, a / 2) for y in (-b / 2, b / 2)])
    inside = rng.uniform(-0.5, 0.5, (2000, 2)) * [a, b]
    c, s = np.cos(angle), np.sin(angle)
    xy = np.concatenate([corners, inside]) @ np.array([[c, s], [-s, c]])
    return np.column_stack([xy, rng.uniform(0, h, len(xy))])


@pytest.mark.parametrize("degrees", [0, 30, 65, -40])
def test_a_turned_block_has_its_sides(degrees):
    size = standing_size(block(0.12, 0.05, 0.2, np.radians(degrees)))
    np.testing.assert_allclose(size, [0.2, 0.12, 0.05], atol=0.001)


def test_stray_points_are_forgotten():
    xy = np.concatenate([block(0.12, 0.05, 0.2, 0)[:, :2], [[0.5, 0.0]]])
    assert footprint(xy)[0] > 0.4
    np.testing.assert_allclose(footprint(xy, 0.99), [0.12, 0.05], atol=0.003)
