"""The plane that objects stand on, where it is not the largest one."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.config import FloorConfig
from brrp_cli.observation.support_plane import Plane, floor_beneath

CONFIG = FloorConfig()
NORMAL = np.array([0.0, -0.6, -0.8])
TABLE = Plane(NORMAL, 0.7)
ALONG = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6]])


def on_table(x, y, height):
    """Points (n, 3), camera frame, above points of the table."""
    foot = -0.7 * NORMAL
    return foot + np.stack([x, y], axis=1) @ ALONG + np.asarray(height)[:, None] * NORMAL


def scene(step, noise=0.0):
    """A table of 1 x 1 m on which a square of 0.3 m is `step` higher, and a thing on it."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.5, 0.5, (2, 60_000))
    under = (np.abs(x) < 0.05) & (np.abs(y) < 0.05)
    x, y = x[~under], y[~under]
    raised = (np.abs(x) < 0.15) & (np.abs(y) < 0.15)
    background = on_table(x, y, step * raised + rng.normal(0, 1, len(x)) * noise)
    thing = on_table(*rng.uniform(-0.05, 0.05, (2, 2_000)), np.full(2_000, 0.06))
    return background, thing


@pytest.mark.parametrize("step", [0.004, 0.012, -0.008])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_it_is_the_step_that_the_thing_stands_on(step, noise):
    floor = floor_beneath(TABLE, *scene(step, noise), CONFIG)
    np.testing.assert_array_equal(floor.normal, NORMAL)
    top = on_table(np.zeros(1), np.zeros(1), np.array([step]))
    assert floor.signed_distance(top)[0] == pytest.approx(0, abs=0.0005)


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_on_a_flat_table_it_stays(noise):
    assert floor_beneath(TABLE, *scene(0.0, noise), CONFIG) is TABLE


def test_walls_around_the_thing_do_not_raise_it():
    background, thing = scene(0.006)
    rng = np.random.default_rng(1)
    wall = on_table(
        rng.uniform(-0.08, 0.08, 3_000), np.full(3_000, 0.08), rng.uniform(0, 0.2, 3_000)
    )
    floor = floor_beneath(TABLE, np.concatenate([background, wall]), thing, CONFIG)
    assert floor.offset == pytest.approx(0.7 - 0.006, abs=0.0005)


def test_where_nothing_is_seen_around_the_thing_it_stays():
    background, thing = scene(0.01)
    far = np.abs(background[:, 0]) > 0.2
    assert floor_beneath(TABLE, background[far], thing, CONFIG) is TABLE
    assert floor_beneath(TABLE, background, thing[:0], CONFIG) is TABLE


def test_sight_meets_a_plane_before_the_camera_and_none_behind_it():
    plane = Plane(np.array([0.0, -0.6, -0.8]), 0.8)
    met = plane.met_by(np.array([[0.0, 0.0, 1.0], [0.3, 1.0, 0.25], [0.0, -1.0, 0.1]]))
    np.testing.assert_allclose(met[:2], [[0.0, 0.0, 1.0], [0.3, 1.0, 0.25]])
    np.testing.assert_allclose(plane.signed_distance(met[:2]), 0.0, atol=1e-12)
    assert np.isnan(met[2]).all()
