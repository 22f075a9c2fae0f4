"""A mask grown or opened within its box is the mask grown or opened within the image."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_opening

from brrp_cli.frames.dilate import dilated, mask_box, opened, widened


@pytest.mark.parametrize("pixels", [0, 1, 4, 40])
@pytest.mark.parametrize("at", [(0, 0), (9, 14), (5, 6)])
def test_within_the_image_and_at_its_edges(pixels, at):
    mask = np.zeros((10, 15), bool)
    mask[at] = True
    mask[6, 8] = True
    expected = binary_dilation(mask, iterations=pixels) if pixels else mask
    np.testing.assert_array_equal(dilated(mask, pixels), expected)


def test_nothing_stays_nothing_and_the_mask_as_it_was():
    nothing = np.zeros((3, 4), bool)
    assert not dilated(nothing, 2).any()
    mask = np.eye(4, dtype=bool)
    dilated(mask, 1)[:] = False
    dilated(mask, 0)[:] = False
    assert mask.sum() == 4


@pytest.mark.parametrize("pixels", [0, 1, 2])
@pytest.mark.parametrize("corner", [(0, 0), (3, 4), (7, 10)])
def test_what_is_narrow_goes_in_the_middle_and_at_the_edges(pixels, corner):
    """A blob of five by five pixels, as far as the image reaches, and a line."""
    mask = np.zeros((10, 15), bool)
    mask[corner[0] : corner[0] + 5, corner[1] : corner[1] + 5] = True
    mask[:, 2] = True
    expected = binary_opening(mask, iterations=pixels) if pixels else mask
    np.testing.assert_array_equal(opened(mask, pixels), expected)


def test_a_box_holds_the_mask_and_what_is_around_it():
    mask = np.zeros((10, 15), bool)
    assert not opened(mask, 1).any() and mask[mask_box(mask, 3)].size == 0
    mask[4, 5] = mask[6, 12] = True
    assert mask_box(mask, 0) == (slice(4, 7), slice(5, 13))
    assert mask[mask_box(mask, 5)].shape == (10, 15)


def test_a_window_is_widened_as_far_as_the_image_reaches():
    image = np.zeros((20, 30))
    assert image[widened(np.s_[5:8, 1:4], 2)].shape == (7, 6)  # not beyond the left edge
    assert image[widened(np.s_[15:19, 10:30], 3)].shape == (8, 23)
