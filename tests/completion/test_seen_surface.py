"""The logit about what was seen: a ramp, bounded on the sides that the depth tells of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.completion.seen_surface import Bounds, SeenSurface, joined, seen_surface
from brrp_cli.config import MeanConfig, RampConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.observation.pixel_noise import PixelNoise
from brrp_cli.observation.support_plane import Plane

MEAN = MeanConfig()
K = np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]])
OWN = 1
SHELL = 0.004


def wall(depth=1.0):
    """Object 1 at 1 m in rows 20 to 59 and columns 40 to 79, before a wall at 2 m."""
    image = np.full((80, 100), 2.0)
    segmap = np.zeros((80, 100), np.int64)
    segmap[20:60, 40:80] = OWN
    image[20:60, 40:80] = depth
    return Frame(np.zeros((80, 100, 3), np.uint8), backproject(image, K), segmap, K)


def noise(frame, wave=0.001, at_jump=None):
    nowhere = np.zeros(frame.shape, bool)
    fine = np.full(frame.shape, 0.001, np.float32)
    return PixelNoise(fine, nowhere if at_jump is None else at_jump, wave, 1.0, 1.0)


def leaning(degrees, depth=1.0):
    """The same object, but its plane leans away at the top, about the row of the camera's axis."""
    frame = wall()
    slope = np.tan(np.radians(degrees))
    rows = (np.arange(80)[:, None] - 40) / 100
    image = np.where(frame.segmap == OWN, depth / (1 + slope * rows), 2.0)
    return Frame(frame.rgb, backproject(image, K), frame.segmap, K)


def straight_on(frame):
    return np.ones(frame.shape, np.float32)


def at(column, z, row=40):
    return [(column - 50) / 100 * z, (row - 40) / 100 * z, z]


@pytest.mark.parametrize(
    ("point", "least", "most", "why"),
    [
        (at(60, 1.0), 0.0, None, "on it"),
        (at(60, 1.0015), 1.0, None, "half a ramp behind it"),
        (at(60, 1.0035), 2.33, None, "at the end of the shell"),
        (at(60, 1.005), None, None, "behind the shell"),
        (at(60, 0.9985), -1.0, -1.0, "half a ramp in front of it"),
        (at(60, 0.99), None, -2.67, "far in front of it"),
        (at(40, 0.9985), None, None, "in front of the mask's outline"),
        (at(40, 0.9995), 0.33, None, "at the mask's outline, by less than a wave"),
        (at(40, 1.0015), 1.67, None, "behind the mask's outline"),
        (at(20, 1.0), None, None, "beside it"),
        ([0.0, 0.0, -1.0], None, None, "behind the camera"),
    ],
)
def test_bounds_are_the_ramp_on_the_sides_that_are_known(point, least, most, why):
    frame = wall()
    surface = seen_surface(frame, OWN, None, noise(frame), MEAN.ramp)
    found = surface.bounds(np.array([point]), SHELL, MEAN)
    assert found.least[0] == pytest.approx(-MEAN.limit if least is None else least, abs=0.02), why
    assert found.most[0] == pytest.approx(MEAN.limit if most is None else most, abs=0.02), why


def test_a_leaning_surface_has_no_stairs():
    """A plane, of which 1 / z is a linear function of the pixel; a pixel's own depth is none."""
    columns = np.arange(100.0)
    frame = wall(1 / (1.0 + 0.02 * (columns[40:80] - 60)))
    surface = SeenSurface(frame, OWN, frame.segmap == OWN, 0.001, straight_on(frame))
    between = np.linspace(55, 65, 41)
    on_it = np.array([at(column, 1 / (1.0 + 0.02 * (column - 60))) for column in between])
    np.testing.assert_allclose(surface.behind(on_it), 0, atol=1e-6)


def test_between_sure_pixels_and_others_the_nearest_one_counts():
    frame = wall()
    sure = np.zeros(frame.shape, bool)
    sure[:, :60] = True
    surface = SeenSurface(frame, OWN, sure, 0.001, straight_on(frame))
    found = surface.behind(np.array([at(59.7, 1.002), at(79.4, 1.002), at(79.6, 1.002)]))
    np.testing.assert_allclose(found, [0.002, 0.002, -0.998], atol=1e-6)


def test_behind_the_camera_and_beside_the_image_nothing_was_seen():
    frame = wall()
    surface = SeenSurface(frame, OWN, np.ones(frame.shape, bool), 0.001, straight_on(frame))
    points = np.array([[0.0, 0, -1], [0, 0, 0], at(-5, 1.0), at(150, 1.0), at(60, 1.0, row=-9)])
    assert np.isnan(surface.behind(points)).all()


def test_depth_at_a_jump_says_nothing_of_what_is_in_front():
    frame = wall()
    everywhere = np.ones(frame.shape, bool)
    sure = seen_surface(frame, OWN, None, noise(frame), MEAN.ramp).sure
    assert sure[40, 60] and not sure[40, 40] and not sure[40, 20]
    assert not seen_surface(frame, OWN, None, noise(frame, 0.001, everywhere), MEAN.ramp).sure.any()


def test_depth_close_to_the_plane_may_be_the_planes():
    """A plane that faces the camera, a little behind the object."""
    frame = wall()
    config = replace(RampConfig(), rise=4.0)
    for gap, told in ((0.003, False), (0.005, True)):
        plane = Plane(np.array([0.0, 0.0, -1.0]), 1.0 + gap)
        assert seen_surface(frame, OWN, plane, noise(frame), config).sure.any() == told


def test_logits_are_kept_within_bounds_and_between_those_that_contradict():
    bounds = joined(
        [
            Bounds(np.array([-5.0, 1.0, 1.0]), np.array([5.0, 5.0, 5.0])),
            Bounds(np.array([-5.0, -5.0, -5.0]), np.array([-1.0, 5.0, -2.0])),
        ]
    )
    np.testing.assert_allclose(bounds.applied(np.zeros(3)), [-1.0, 1.0, -0.5])
    np.testing.assert_allclose(bounds.applied(np.array([-3.0, 2.0, 4.0])), [-3.0, 2.0, -0.5])


def test_pixels_without_depth_bound_nothing():
    frame = wall()
    points = frame.points.copy()
    points[frame.segmap == OWN] = np.nan
    blind = SeenSurface(
        frame.with_points(points), OWN, frame.segmap == OWN, 0.001, straight_on(frame)
    )
    found = blind.bounds(np.array([at(60, 0.99), at(60, 1.001)]), SHELL, MEAN)
    assert (found.least == -MEAN.limit).all() and (found.most == MEAN.limit).all()


@pytest.mark.parametrize("degrees", [30, 60])
def test_a_wall_that_leans_is_as_thick_across_as_one_that_does_not(degrees):
    """On the camera's axis a way along it is 1 / cos times as long."""
    frame = leaning(degrees)
    surface = seen_surface(frame, OWN, None, noise(frame), MEAN.ramp)
    along = np.array([0.0, 0.0005, 0.0015, 0.0035, 0.0045]) / np.cos(np.radians(degrees))
    points = np.array([at(60, 1.0 + each) for each in along])
    bounds = surface.bounds(points, SHELL, MEAN)
    expected = [0.0, 1 / 3, 1.0, 7 / 3, -MEAN.limit]
    np.testing.assert_allclose(bounds.least, expected, atol=0.03)


def test_a_shell_ends_at_the_plane_on_which_the_object_stands():
    """The plane meets the wall between rows 49 and 50, or 0.2 mm above row 50."""
    frame, config = wall(), replace(MEAN, sunk=0.001)
    table = Plane(np.array([0.0, -1.0, 0.0]), 0.1)
    surface = SeenSurface(frame, OWN, frame.segmap == OWN, 0.001, straight_on(frame), table)
    points = np.array([at(60, 1.002, row) for row in (49, 50, 51)])
    np.testing.assert_allclose(table.signed_distance(points), [0.00982, -0.0002, -0.01022])
    least = surface.bounds(points, SHELL, config).least
    np.testing.assert_allclose(least, [4 / 3, 4 / 3, -config.limit])
    whole = replace(surface, plane=None).bounds(points, SHELL, config)
    np.testing.assert_allclose(whole.least, 4 / 3)
