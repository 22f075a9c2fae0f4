"""Pixels that show another object, on depth images whose parts are known."""

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config.observation import LentPixelsConfig
from brrp_cli.observation.lent_pixels import lent_pixels

CONFIG = LentPixelsConfig()
ROWS, COLUMNS = np.s_[10:40], np.s_[10:50]
IN_FRONT, FAR, TABLE = 0.6, 0.7, 0.9


@pytest.fixture
def mask():
    found = np.zeros((50, 70), dtype=bool)
    found[ROWS, COLUMNS] = True
    return found


@pytest.fixture
def others():
    found = np.zeros((50, 70), dtype=bool)
    found[:, 50:] = True
    return found


@pytest.fixture
def depth(mask, others):
    """A board 0.7 m away over a table at 0.9 m, and what stands before it on the right, at 0.6."""
    return np.where(mask, FAR, np.where(others, IN_FRONT, TABLE))


def test_depth_that_runs_over_from_what_stands_before_is_lent(depth, mask, others):
    depth[ROWS, 47:50] = IN_FRONT + 0.005
    expected = np.zeros_like(mask)
    expected[ROWS, 47:50] = True
    np.testing.assert_array_equal(lent_pixels(depth, mask, others, CONFIG), expected)


def test_edges_with_the_depth_of_the_object_stay(depth, mask, others):
    assert not lent_pixels(depth, mask, others, CONFIG).any()


def test_the_table_is_no_object(depth, mask, others):
    depth[ROWS, 10:12] = TABLE
    assert not lent_pixels(depth, mask, others, CONFIG).any()


def test_what_is_as_deep_as_its_neighbour_all_over_stays(depth, mask, others):
    depth[:, 50:] = FAR + 0.004
    assert not lent_pixels(depth, mask, others, CONFIG).any()


def test_a_face_that_comes_up_to_its_neighbour_stays(depth, mask, others):
    depth[ROWS, COLUMNS] = np.linspace(FAR, IN_FRONT, 40)
    assert not lent_pixels(depth, mask, others, CONFIG).any()


def test_only_the_edge_is_lent(depth, mask, others):
    depth[ROWS, 40:50] = IN_FRONT
    found = lent_pixels(depth, mask, others, replace(CONFIG, reach=20))
    assert not found[:, :47].any()


def test_what_is_too_narrow_to_have_an_inside_stays(depth, mask, others):
    mask[:, :45] = False
    depth[ROWS, 45:50] = IN_FRONT
    assert not lent_pixels(depth, mask, others, CONFIG).any()


def test_what_goes_on_beyond_the_image_has_no_edge_there(depth, mask, others):
    depth[ROWS, 47:50] = IN_FRONT
    cut = np.s_[15:35]
    np.testing.assert_array_equal(
        lent_pixels(depth[cut], mask[cut], others[cut], CONFIG),
        lent_pixels(depth, mask, others, CONFIG)[cut],
    )


def test_pixels_without_depth_are_not_lent(depth, mask, others):
    depth[ROWS, 47:50] = np.nan
    assert not lent_pixels(depth, mask, others, CONFIG).any()
    assert not lent_pixels(np.full_like(depth, np.nan), mask, others, CONFIG).any()
