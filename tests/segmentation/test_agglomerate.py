"""Parts joined by what is said of their pixels, where the answer is known."""

import numpy as np
import pytest

from brrp_cli.segmentation.agglomerate import borders_of, join_alike_pixels
from brrp_cli.segmentation.learned_affinities import Affinities
from brrp_cli.segmentation.pixel_pairs import OFFSETS, windows

SHAPE = (40, 60)


def told(objects, sure=0.9):
    """Affinities of which each is right, and `sure` of it."""
    same = np.zeros((len(OFFSETS), *SHAPE), np.float32)
    for each, offset in zip(same, OFFSETS, strict=True):
        pixel, partner = windows(offset, SHAPE)
        each[pixel] = np.where(objects[pixel] == objects[partner], sure, 1 - sure)
    return Affinities(same, (objects > 0).astype(np.float32), OFFSETS, SHAPE)


def stripes(*widths):
    """Labels 1, 2, ... of upright stripes."""
    row = np.repeat(np.arange(1, len(widths) + 1), widths)
    return np.broadcast_to(row, SHAPE).copy()


@pytest.mark.parametrize("offset", [*OFFSETS, (-2, 3), (0, -5)])
def test_partners_lie_at_their_offset(offset):
    rows, columns = np.indices(SHAPE)
    pixel, partner = windows(offset, SHAPE)
    assert (rows[partner] - rows[pixel] == offset[0]).all()
    assert (columns[partner] - columns[pixel] == offset[1]).all()
    assert rows[pixel].size == (SHAPE[0] - abs(offset[0])) * (SHAPE[1] - abs(offset[1]))


def test_no_pixel_of_a_small_image_has_a_partner_beyond_it():
    small = np.zeros((20, 60))
    for offset in ((32, 0), (32, -32), (-32, 32)):
        assert small[windows(offset, small.shape)[0]].size == 0
        assert small[windows(offset, small.shape)[1]].size == 0


def test_a_border_lies_between_the_pixels_that_differ():
    border = borders_of(told(stripes(20, 40)))
    assert (border[:, 19:21] > 0.8).all()
    assert (border[:, :18] < 0.2).all() and (border[:, 22:] < 0.2).all()


def test_pieces_of_one_object_are_joined_and_objects_are_not():
    objects = stripes(30, 30)
    parts = stripes(10, 12, 8, 15, 15)
    joined = join_alike_pixels(parts, told(objects), 0.5)
    assert np.array_equal(joined, objects)


def test_what_something_lies_in_front_of_is_one_by_pixels_that_lie_far_apart():
    parts = stripes(20, 10, 30)
    objects = np.where(parts == 2, 2, 1)
    joined = join_alike_pixels(parts, told(objects), 0.5)
    assert joined[0, 0] == joined[0, 50] != joined[0, 25]


def test_one_wrong_border_changes_little():
    parts = stripes(30, 30)
    affinities = told(np.ones(SHAPE, np.int64))
    near = [max(offset) == 2 for offset in OFFSETS]
    affinities.same[near, :, 27:33] = 0.0
    assert len(np.unique(join_alike_pixels(parts, affinities, 0.5))) == 1


def test_background_joins_nothing():
    parts = stripes(20, 20, 20)
    parts[parts == 2] = 0
    joined = join_alike_pixels(parts, told(parts), 0.5)
    assert np.unique(joined).tolist() == [0, 1, 2]
    assert np.array_equal(join_alike_pixels(0 * parts, told(parts), 0.5), 0 * parts)
