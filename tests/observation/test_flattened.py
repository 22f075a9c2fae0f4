"""Low things that were smoothed together with the table are as high again as they were."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, gaussian_filter
from table_scene import TABLE, in_camera, photograph, placed

from brrp_cli.config import FlatteningConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.flattened import raised, smoothing_width
from brrp_cli.shapes import solids

CONFIG = FlatteningConfig()
HEIGHT = 0.012
THINGS = {
    1: solids.box(0.15, 0.02, HEIGHT),
    2: solids.box(0.06, 0.04, HEIGHT),
    3: solids.box(0.05, 0.05, 0.1),
}
PLACES = {1: placed(0.0, 0.08, 0.4), 2: placed(0.06, -0.06, 1.0), 3: placed(-0.13, -0.06, 0.2)}
LOW = (1, 2)


def seen(*ids: int) -> Frame:
    return photograph({i: in_camera(THINGS[i], PLACES[i]) for i in ids})


def smoothed(frame: Frame, width: float, noise: float = 0.0) -> Frame:
    """As a camera measures it that mixes low things and the table over `width` pixels, but nothing
    with what is higher."""
    rng = np.random.default_rng(0)
    inverse = 1 / np.where(frame.valid, frame.depth, np.nan).astype(np.float64)
    inverse += noise * rng.normal(size=frame.shape) * inverse**2
    mixed = frame.valid & (frame.segmap != 3)
    whole = gaussian_filter(mixed.astype(np.float64), width)
    total = gaussian_filter(np.where(mixed, inverse, 0.0), width)
    measured = 1 / np.where(mixed, total / np.where(mixed, whole, 1.0), inverse)
    points = frame.points * (measured / frame.depth)[..., None]
    return frame.with_points(points.astype(np.float32))


def height(frame: Frame, object_id: int) -> float:
    """Metres, the mean over what is seen of it."""
    return float(TABLE.signed_distance(frame.object_points(object_id)).mean())


@pytest.mark.parametrize("width", [3.0, 5.0])
def test_the_width_is_that_of_the_camera(width):
    frame = smoothed(seen(*LOW), width, noise=0.0005)
    assert smoothing_width(frame, TABLE, CONFIG) == width


def test_low_things_are_as_high_as_they_were_and_the_table_as_low():
    truth = seen(1, 2, 3)
    frame = smoothed(truth, 5.0)
    found = raised(frame, TABLE, smoothing_width(frame, TABLE, CONFIG), CONFIG)
    for i in LOW:
        # A third of what is low was lost.
        assert height(frame, i) < 0.7 * height(truth, i)
        assert height(found, i) == pytest.approx(height(truth, i), rel=0.1)
    around = distance_transform_edt(~np.isin(truth.segmap, LOW)) < 10
    alone = distance_transform_edt(truth.segmap != 3) > 20
    table = around & alone & (truth.segmap == 0)
    before, after = (TABLE.signed_distance(each.points[table]).mean() for each in (frame, found))
    assert before > 0.0015 and abs(after) < 0.0003


def test_points_stay_on_their_rays_and_what_is_high_stays_as_it_is():
    frame = smoothed(seen(1, 2, 3), 5.0)
    found = raised(frame, TABLE, 5.0, CONFIG)
    np.testing.assert_allclose(
        found.points[..., :2] / found.points[..., 2:],
        frame.points[..., :2] / frame.points[..., 2:],
        rtol=1e-5,
    )
    np.testing.assert_array_equal(found.object_points(3), frame.object_points(3))


def test_one_thing_alone_is_raised_as_it_is_with_the_others():
    frame = smoothed(seen(1, 2, 3), 5.0)
    every, one = raised(frame, TABLE, 5.0, CONFIG), raised(frame, TABLE, 5.0, CONFIG, only=2)
    np.testing.assert_array_equal(one.object_points(2), every.object_points(2))
    np.testing.assert_array_equal(one.object_points(1), frame.object_points(1))


@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_a_camera_that_smooths_nothing_has_no_width(noise):
    frame = smoothed(seen(1, 2, 3), 1e-6, noise)
    assert smoothing_width(frame, TABLE, CONFIG) == 0
    assert raised(frame, TABLE, 0.0, CONFIG) is frame


def test_without_a_plane_and_without_low_things_nothing_is_told():
    assert smoothing_width(smoothed(seen(*LOW), 5.0), None, CONFIG) == 0
    assert smoothing_width(smoothed(seen(3), 5.0), TABLE, CONFIG) == 0


def test_a_thing_towards_which_the_table_does_not_rise_is_left_as_it_is():
    """One that the camera does not smooth, though it does another one."""
    truth, frame = seen(*LOW), smoothed(seen(*LOW), 5.0)
    to_one, to_two = (distance_transform_edt(truth.segmap != i) for i in LOW)
    points = np.where((to_two < to_one)[..., None], truth.points, frame.points)
    frame = frame.with_points(points)
    found = raised(frame, TABLE, 5.0, CONFIG)
    np.testing.assert_array_equal(found.object_points(2), frame.object_points(2))
    assert height(found, 1) == pytest.approx(height(truth, 1), rel=0.1)
