"""The picture of the masks."""

from __future__ import annotations

import numpy as np

from brrp_cli.segmentation.mask_picture import PALETTE, draw_masks


def test_objects_are_coloured_and_background_is_left_alone():
    rgb = np.full((120, 160, 3), 100, np.uint8)
    segmap = np.zeros((120, 160), np.int64)
    segmap[20:100, 10:70], segmap[20:100, 90:150] = -4, 250
    before = rgb.copy()
    picture = draw_masks(rgb, segmap)
    assert (picture[segmap == 0] == 100).all()
    assert np.array_equal(picture[20, 10], PALETTE[0])
    assert np.array_equal(picture[20, 90], PALETTE[1])
    inner = 0.55 * 100 + 0.45 * PALETTE[0]
    assert np.abs(picture[25, 15] - inner).max() <= 1
    written = np.abs(picture[30:90, 20:60] - inner).max(axis=-1) > 50
    assert 10 < written.sum() < 1000, "the id is written on the object"
    assert np.array_equal(rgb, before)


def test_a_picture_without_objects_is_the_image():
    rgb = np.random.default_rng(0).integers(0, 255, (30, 40, 3)).astype(np.uint8)
    assert np.array_equal(draw_masks(rgb, np.zeros((30, 40), np.int64)), rgb)
