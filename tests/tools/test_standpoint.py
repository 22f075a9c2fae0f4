"""Where the cameras of made scenes stand."""

from __future__ import annotations

import numpy as np
import pytest
from tabletop.camera import Standpoint, draw_camera, gone_round

from brrp_cli.errors import SceneError

CENTER = np.array([0.1, -0.2, 0.05])
SIZE = (64, 48)
SLACK = 0.03 * np.sqrt(3)  # the target is drawn within 3 cm of the centre along each axis


def drawn(standpoint=None, count=50):
    rng = np.random.default_rng(5)
    return [draw_camera(CENTER, SIZE, rng, standpoint).view for _ in range(count)]


def place(view):
    """The camera's place, world frame."""
    return -view[:3, :3].T @ view[:3, 3]


@pytest.mark.parametrize(
    "standpoint",
    [Standpoint(), Standpoint((0.3, 0.5), (70.0, 89.0)), Standpoint((1.2, 1.6), roll=(-180, 180))],
    ids=["usual", "above", "far and rolled"],
)
def test_cameras_stand_within_the_ranges_and_look_at_the_centre(standpoint):
    for view in drawn(standpoint):
        R, eye = view[:3, :3], place(view)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0)
        elevation = np.rad2deg(np.arcsin(R[2, 2]))  # the camera looks along its own -z
        assert standpoint.elevation[0] <= elevation <= standpoint.elevation[1]
        low, high = standpoint.distance
        assert low - SLACK <= np.linalg.norm(eye - CENTER) <= high + SLACK
        ahead = (CENTER - eye) @ -R[2]
        assert np.linalg.norm(CENTER - eye + ahead * R[2]) <= SLACK


def test_only_what_is_rolled_has_a_slanting_horizon():
    upright = drawn()
    assert max(abs(view[0, 2]) for view in upright) < 1e-12
    for view in drawn(Standpoint(roll=(90.0, 90.0))):
        # Turned by a quarter: the image's right, once level, is the way up that it had.
        assert abs(view[1, 2]) < 1e-12 and abs(view[0, 2]) > 0.4
    rolls = [np.arctan2(v[0, 2], v[1, 2]) for v in drawn(Standpoint(roll=(-180.0, 180.0)))]
    assert min(rolls) < -2 and max(rolls) > 2


def test_upright_cameras_draw_no_roll():
    one, other = drawn(count=3), drawn(Standpoint(), count=3)
    assert all((a == b).all() for a, b in zip(one, other, strict=True))
    # Distances and elevations of a rolled one are the first that an upright one gets.
    rolled = drawn(Standpoint(roll=(-10.0, 10.0)), count=1)[0]
    np.testing.assert_allclose(place(rolled), place(one[0]))


@pytest.mark.parametrize(
    ("ranges", "named"),
    [
        ({"distance": (0.0, 1.0)}, "--distance"),
        ({"elevation": (60.0, 90.0)}, "--elevation"),
        ({"elevation": (60.0, 30.0)}, "--elevation"),
        ({"roll": (0.0, float("nan"))}, "--roll"),
    ],
)
def test_ranges_in_which_no_camera_stands_are_told(ranges, named):
    with pytest.raises(SceneError, match=named):
        Standpoint(**ranges)


def test_a_camera_that_goes_round_keeps_its_height_and_what_it_looks_at():
    rng = np.random.default_rng(5)
    first = draw_camera(CENTER, SIZE, rng, Standpoint(roll=(-40.0, 40.0)))
    quarter = gone_round(first, CENTER, 90.0)
    way, gone = place(first.view) - CENTER, place(quarter.view) - CENTER
    np.testing.assert_allclose(gone, [-way[1], way[0], way[2]], atol=1e-12)
    at = np.append(CENTER, 1.0)
    np.testing.assert_allclose(quarter.view @ at, first.view @ at, atol=1e-12)
    np.testing.assert_allclose(gone_round(quarter, CENTER, -90.0).view, first.view, atol=1e-12)
