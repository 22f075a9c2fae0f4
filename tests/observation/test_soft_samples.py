"""What the sensor's noise makes of observed samples: probabilities, in front of and behind."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from brrp_cli.config import SensorConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind
from brrp_cli.geometry import backproject
from brrp_cli.observation.ray_samples import ObjectObservation
from brrp_cli.observation.sensor_noise import depth_deviation
from brrp_cli.observation.soft_samples import soft_samples

CONFIG = SensorConfig()
K = np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]])
OWN, OTHER, DEPTH, WAY = 1, 2, 0.8, 0.004
DEVIATION = CONFIG.noise + CONFIG.noise_growth * DEPTH**2


@pytest.fixture(scope="module")
def frame():
    """A wall at 0.8 m: object 1 in columns 40 to 59, object 2 in columns 70 to 79."""
    segmap = np.zeros((80, 100), np.int64)
    segmap[20:60, 40:60], segmap[20:60, 70:80] = OWN, OTHER
    points = backproject(np.full((80, 100), DEPTH), K)
    return Frame(np.zeros((80, 100, 3), np.uint8), points, segmap, K)


def at(column, z, row=40):
    """The point at depth z that the camera sees in a pixel."""
    return [(column - 50) / 100 * z, (row - 40) / 100 * z, z]


def asked(frame, occupied=(), free=()):
    """Samples of object 1 from points of its surface and others that are free."""
    occupied, free = (np.array(p, np.float32).reshape(-1, 3) for p in (occupied, free))
    samples = np.concatenate([occupied, free])
    labels = np.arange(len(samples)) < len(occupied)
    own = frame.object_points(OWN)
    observation = ObjectObservation(OWN, own, own.mean(axis=0).astype(float), samples, labels)
    found = soft_samples(observation, frame, WAY, CONFIG)
    return found.points, found.targets, found.measured


def test_the_deviation_grows_with_the_square_of_the_depth():
    found = depth_deviation(np.array([0.0, 1.0, 2.0]), CONFIG)
    steps = CONFIG.noise_growth * np.array([0, 1, 4])
    np.testing.assert_allclose(found, CONFIG.noise + steps)


def test_the_seen_surface_is_asked_in_front_and_behind_and_lies_in_the_middle(frame):
    surface = [at(c, DEPTH, r) for c in range(42, 58, 5) for r in (25, 40, 55)]
    points, targets, measured = asked(frame, surface)
    count = len(surface)
    assert points.shape == (2 * count, 3) and targets.shape == (2 * count,)
    behind, before = points[:count], points[count:]
    np.testing.assert_allclose((behind + before) / 2, surface, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(behind - before, axis=1), 2 * WAY, rtol=1e-6)
    assert (behind[:, 2] > before[:, 2]).all()
    # Along the ray: each pair is seen in one pixel.
    np.testing.assert_allclose(np.cross(behind, before), 0, atol=1e-9)
    np.testing.assert_allclose(measured, np.tile(surface, (2, 1)), atol=1e-6)


def test_probabilities_are_those_of_the_sensors_noise_and_symmetric(frame):
    """A surface that lies anywhere within the noise, a normal distribution: the point behind by
    `WAY` is inside where it lies before that point."""
    _, targets, _ = asked(frame, [at(50, DEPTH), at(45, DEPTH)])
    behind, before = targets[:2], targets[2:]
    np.testing.assert_allclose(behind, norm.cdf(WAY, scale=DEVIATION), rtol=1e-6)
    np.testing.assert_allclose(behind + before, 1)
    assert 0.9 < behind[0] < 1


def test_the_measurement_itself_is_as_much_in_as_out(frame):
    observation = ObjectObservation(
        OWN, np.zeros((0, 3)), np.zeros(3), np.array([at(50, DEPTH)], np.float32), np.array([True])
    )
    targets = soft_samples(observation, frame, 0.0, CONFIG).targets
    np.testing.assert_allclose(targets, 0.5)


def test_far_away_the_same_way_says_less(frame):
    near, far = (asked(frame, [at(50, z)])[1][0] for z in (0.5, 2.0))
    assert 0.5 < far < near < 1


def test_free_samples_within_the_noise_of_what_was_measured_say_nothing(frame):
    sure = CONFIG.sure * DEVIATION
    free = [at(50, DEPTH - 0.9 * sure), at(50, DEPTH - 1.1 * sure), at(50, 0.3), at(50, DEPTH)]
    points, targets, measured = asked(frame, free=free)
    np.testing.assert_allclose(points, np.float32([free[1], free[2]]), atol=1e-6)
    np.testing.assert_array_equal(targets, 0)
    assert np.isnan(measured).all()


def test_samples_below_the_plane_or_out_of_sight_stay_free(frame):
    """Nothing was measured near them: noise of depth has no say."""
    free = [at(50, 1.2), at(-60, DEPTH), [0.0, 0.0, -1.0]]
    points, targets, _ = asked(frame, free=free)
    np.testing.assert_allclose(points, np.float32(free), atol=1e-6)
    np.testing.assert_array_equal(targets, 0)


def test_the_surface_of_another_object_is_free_behind_where_it_is_that_objects(frame):
    points, targets, measured = asked(frame, free=[at(75, DEPTH), at(10, DEPTH)])
    # The background's own surface is dropped: it is as much free as not.
    assert len(points) == 1
    moved = np.array(at(75, DEPTH))
    np.testing.assert_allclose(points[0], moved * (1 + WAY / np.linalg.norm(moved)), atol=1e-6)
    assert depth_behind(points, frame)[0] < -0.9 * WAY * DEPTH / np.linalg.norm(moved)
    np.testing.assert_array_equal(targets, 0)
    assert np.isnan(measured).all()


def test_all_kinds_of_samples_come_together(frame):
    points, targets, measured = asked(
        frame, [at(50, DEPTH)], [at(75, DEPTH), at(50, 0.5), at(50, DEPTH)]
    )
    assert len(points) == len(targets) == len(measured) == 4
    np.testing.assert_array_equal(np.isnan(measured[:, 0]), [False, False, True, True])
    np.testing.assert_array_equal(targets[2:], 0)


def test_without_samples_there_is_nothing(frame):
    points, targets, measured = asked(frame)
    assert points.shape == measured.shape == (0, 3) and targets.shape == (0,)
