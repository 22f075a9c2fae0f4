"""Parts joined by what is said of their pixels, where the answer is known."""

import numpy as np
import pytest

from brrp_cli.config.segmentation import AffinitiesConfig
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


def joined(parts, affinities, depth=None):
    """Labels after those more alike than not were joined; depth is one plane unless given."""
    depth = np.ones(SHAPE) if depth is None else depth
    return join_alike_pixels(parts, affinities, depth, AffinitiesConfig(alike=0.5, step=0.08))


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
    assert np.array_equal(joined(parts, told(objects)), objects)


def test_what_something_lies_in_front_of_is_one_by_pixels_that_lie_far_apart():
    parts = stripes(20, 10, 30)
    objects = np.where(parts == 2, 2, 1)
    found = joined(parts, told(objects))
    assert found[0, 0] == found[0, 50] != found[0, 25]


def test_one_wrong_border_changes_little():
    parts = stripes(30, 30)
    affinities = told(np.ones(SHAPE, np.int64))
    near = [max(offset) == 2 for offset in OFFSETS]
    affinities.same[near, :, 27:33] = 0.0
    assert len(np.unique(joined(parts, affinities))) == 1


@pytest.mark.parametrize(("metres", "things"), [(0.06, 1), (0.1, 2)])
def test_what_stands_far_in_front_of_another_thing_is_a_thing_of_its_own(metres, things):
    parts, one = stripes(30, 30), np.ones(SHAPE, np.int64)
    depth = np.where(parts == 1, 0.8, 0.8 + metres)
    assert len(np.unique(joined(parts, told(one), depth))) == things


def test_a_step_is_none_where_depth_is_missing_and_parts_beside_it_lie_as_deep():
    parts, one = stripes(20, 20, 20), np.ones(SHAPE, np.int64)
    depth = np.where(parts == 2, np.nan, 0.8)
    assert len(np.unique(joined(parts, told(one), depth))) == 1


def test_background_joins_nothing():
    parts = stripes(20, 20, 20)
    parts[parts == 2] = 0
    assert np.unique(joined(parts, told(parts))).tolist() == [0, 1, 2]
    assert np.array_equal(joined(0 * parts, told(parts)), 0 * parts)
