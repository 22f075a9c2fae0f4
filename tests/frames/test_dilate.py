"""A mask grown within its box is the mask grown within the image."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from brrp_cli.frames.dilate import dilated


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
