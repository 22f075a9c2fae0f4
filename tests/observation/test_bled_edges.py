"""Depth that runs over into what is behind, on images whose parts are known."""

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config.observation import BledEdgeConfig
from brrp_cli.observation.bled_edges import bled_pixels

CONFIG = BledEdgeConfig()
FOCAL = 600.0
# At 0.8 m a pixel is 1.3 mm wide: steps of 7 mm, over seven pixels.
RAMP = 0.807 + 0.007 * np.arange(7)


@pytest.fixture
def depth():
    """The inside of a bowl, 30 x 40 pixels at 0.8 m, whose upper edge is clean."""
    image = np.full((50, 60), np.nan)
    image[10:40, 10:50] = 0.8
    return image


def found(depth, **numbers):
    return bled_pixels(depth, FOCAL, replace(CONFIG, **numbers))


def with_ramp(depth, ramp=RAMP):
    """Above the upper edge, further away from pixel to pixel."""
    depth[10 - len(ramp) : 10, 10:50] = ramp[::-1, None]
    return depth


def test_a_ramp_over_the_upper_edge_is_found_to_the_pixel(depth):
    assert not found(depth).any()
    expected = np.zeros(depth.shape, dtype=bool)
    expected[3:10, 10:50] = True
    np.testing.assert_array_equal(found(with_ramp(depth)), expected)


def test_what_is_behind_goes_with_it_where_it_is_a_few_pixels(depth):
    with_ramp(depth)
    depth[1:3, 10:50] = RAMP[-1]
    assert found(depth)[1:10, 10:50].all() and found(depth).sum() == 9 * 40
    # More of it may be the object itself, behind a rim.
    assert not found(depth, border=1).any()


def test_columns_are_on_their_own(depth):
    with_ramp(depth)
    depth[3:10, 30:] = np.nan
    assert found(depth)[3:10, 10:30].all() and found(depth).sum() == 7 * 20


@pytest.mark.parametrize(
    "ramp",
    [
        0.802 + 0.002 * np.arange(7),  # a wall that is seen aslant, but seen
        np.array([0.807, 0.814]),  # two steps: an edge as most cameras blur it
        np.full(7, 0.85),  # a jump: `stray_pixels` says whether that is the object's
    ],
)
def test_what_is_no_ramp_stays(depth, ramp):
    assert not found(with_ramp(depth, ramp)).any()


def test_lower_edges_stay(depth):
    assert not found(with_ramp(depth)[::-1]).any()


def test_nothing_and_a_few_rows_have_no_ramp():
    assert not found(np.full((5, 5), np.nan)).any()
    assert not found(np.full((2, 5), 0.8)).any()
