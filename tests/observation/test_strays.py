"""Pixels that their mask holds by mistake, on depth images whose parts are known."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, distance_transform_edt
from table_scene import box, in_camera, photograph, placed

from brrp_cli.config import StrayConfig
from brrp_cli.observation.strays import stray_pixels, without_strays

CONFIG = StrayConfig()
ID = 3


@pytest.fixture
def depth():
    """A board that leans back, 30 x 40 pixels at 0.6 to 0.7 m; nothing around it."""
    image = np.full((50, 60), np.nan)
    image[10:40, 10:50] = np.linspace(0.7, 0.6, 30)[:, None]
    return image


def test_what_lies_far_behind_or_before_is_stray(depth):
    other = np.zeros(depth.shape, dtype=bool)
    other[9, 10:50] = True  # a mask that is a pixel too high: the wall behind it
    other[20:23, 30:33] = True  # a reflex
    depth[9, 10:50], depth[20:23, 30:33] = 1.5, 0.3
    np.testing.assert_array_equal(stray_pixels(depth, CONFIG), other)


def test_scraps_between_the_object_and_what_is_behind_it_are_stray(depth):
    depth[9, 10:50:3] = np.linspace(0.74, 1.4, 14)
    found = stray_pixels(depth, CONFIG)
    assert found[9, 10:50:3].all() and found.sum() == 14


def test_parts_of_an_object_that_something_hides_or_that_lie_deeper_stay(depth):
    depth[:, 25:35] = np.nan  # something in front
    depth[10:40, 35:] += 0.08  # and the other side lies deeper, as a bowl's does
    assert not stray_pixels(depth, CONFIG).any()


def test_a_chain_of_parts_reaches_further_than_one(depth):
    depth[:, 30:] += 0.12
    depth[:, 40:] += 0.12
    assert not stray_pixels(depth, CONFIG).any()
    depth[:, 30:40] = np.nan
    assert stray_pixels(depth, CONFIG)[:, 40:50].sum() == 30 * 10


def test_pixels_that_touch_no_other_are_no_strays(depth):
    sparse = np.full(depth.shape, np.nan)
    sparse[::4, ::4] = depth[::4, ::4]
    assert np.isfinite(sparse).any()
    assert not stray_pixels(sparse, CONFIG).any()


def test_a_frame_without_strays_is_the_same_and_one_with_them_is_as_without():
    frame = photograph({ID: box()})
    assert without_strays(frame, CONFIG) is frame
    own = np.argwhere(frame.segmap == ID)[0]
    points = frame.points.copy()
    points[tuple(own)] *= 3.0
    cleaned = without_strays(replace(frame, points=points), CONFIG)
    away = np.zeros(frame.shape, dtype=bool)
    away[tuple(own)] = True
    np.testing.assert_array_equal(cleaned.valid, frame.valid & ~away)
    np.testing.assert_array_equal(cleaned.points[~away], frame.points[~away])
    np.testing.assert_array_equal(cleaned.segmap, frame.segmap)


def test_a_ramp_at_the_upper_edge_has_no_depth_and_stays_in_the_mask():
    frame = photograph({ID: in_camera(box(), placed(0.0, 0.0, 0.3))})
    rows, columns = np.nonzero(frame.segmap == ID)
    top = rows.min()
    edge = np.arange(columns.min(), columns.max() + 1)[:, None], np.arange(top - 6, top)
    points, segmap = frame.points.copy(), frame.segmap.copy()
    segmap[edge[1], edge[0]] = ID
    # From the nearest depth on: 15 mm further in every pixel, which is 1 to 2 mm wide.
    depth = np.nanmin(frame.depth[frame.segmap == ID]) + 0.015 * np.arange(6, 0, -1)
    points[edge[1], edge[0]] *= (depth / points[edge[1], edge[0], 2])[..., None]
    cleaned = without_strays(replace(frame, points=points, segmap=segmap), CONFIG)
    # The innermost of the six is where the ramp begins, as near as the box.
    assert not cleaned.valid[edge[1], edge[0]][:, :-1].any()
    np.testing.assert_array_equal(cleaned.segmap, segmap)
    own = frame.segmap == ID
    assert cleaned.valid[own].mean() > 0.95


def test_what_another_object_lends_has_no_depth_and_stays_in_the_mask():
    front = 4
    back, before = placed(0.0, 0.0, 0.3), placed(0.15, 0.03, 0.3)
    frame = photograph({ID: in_camera(box(), back), front: in_camera(box(), before)})
    edge = (frame.segmap == ID) & binary_dilation(frame.segmap == front, iterations=2)
    points = frame.points.copy()
    nearest = distance_transform_edt(
        frame.segmap != front, return_distances=False, return_indices=True
    )
    depth = frame.depth[nearest[0][edge], nearest[1][edge]]
    assert edge.sum() > 100 and (frame.depth[edge] - depth > 0.02).all()
    points[edge] *= (depth / points[edge][:, 2])[:, None]
    cleaned = without_strays(replace(frame, points=points), CONFIG)
    assert cleaned.valid[edge].mean() < 0.05
    assert cleaned.valid[(frame.segmap == ID) & ~edge].mean() > 0.99
    np.testing.assert_array_equal(cleaned.segmap, frame.segmap)


@pytest.mark.parametrize("part, told", [(0.01, False), (0.2, True)])
def test_a_message_tells_of_what_is_more_than_a_few_pixels(caplog, part, told):
    frame = photograph({ID: in_camera(box(), placed(0.0, 0.0, 0.3))})
    own = np.argwhere(frame.segmap == ID)
    points = frame.points.copy()
    points[tuple(own[: int(part * len(own))].T)] *= 3.0
    with caplog.at_level(logging.INFO, logger="brrp_cli"):
        without_strays(replace(frame, points=points), StrayConfig(told=0.05))
    assert [f"Object {ID}: " in message for message in caplog.messages] == [True] * told
