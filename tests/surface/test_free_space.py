"""Balls that a frame shows to be empty: a wall at one metre with a block before it."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.config import MeanConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.observation.support_plane import Plane
from brrp_cli.surface.free_space import free_balls

FOCAL, WALL, BLOCK, RADIUS = 500.0, 1.0, 0.8, 0.01
K = np.array([[FOCAL, 0, 80], [0, FOCAL, 60], [0, 0, 1]])
# Columns of the block, and some beside it without depth.
FIRST, LAST, BLIND = 60, 80, slice(120, 130)


@pytest.fixture(scope="module")
def frame():
    depth = np.full((120, 160), WALL)
    depth[:, FIRST:LAST] = BLOCK
    depth[:, BLIND] = np.nan
    segmap = np.zeros(depth.shape, np.int64)
    segmap[:, FIRST:LAST] = 1
    rgb = np.zeros((*depth.shape, 3), np.uint8)
    return Frame(rgb, backproject(depth, K).astype(np.float32), segmap, K)


def at(column, depth):
    return np.array([[(column - 80) / FOCAL * depth, 0.0, depth]])


def free(frame, points, plane=None):
    return free_balls(points, RADIUS, frame, plane, MeanConfig())


@pytest.mark.parametrize(
    "column, depth, empty",
    [
        (30, 0.5, True),
        (30, WALL - 1.1 * RADIUS, True),
        (30, WALL - 0.9 * RADIUS, False),  # the ball touches the wall
        (30, WALL + 0.1, False),  # hidden
        (70, BLOCK - 1.1 * RADIUS, True),
        (70, BLOCK - 0.9 * RADIUS, False),
        (70, BLOCK + 0.1, False),
    ],
)
def test_it_is_free_where_all_of_it_lies_before_what_was_measured(frame, column, depth, empty):
    assert free(frame, at(column, depth)) == [empty]


@pytest.mark.parametrize("depth", [0.85, 0.95])
def test_beside_an_object_it_is_as_wide_as_in_the_image(frame, depth):
    wide = FOCAL * RADIUS / (depth - RADIUS)
    assert not free(frame, at(FIRST - wide + 1.5, depth))
    assert free(frame, at(FIRST - wide - 2.5, depth))


def test_what_shows_nothing_frees_nothing(frame):
    wide = FOCAL * RADIUS / (0.9 - RADIUS)
    assert not free(frame, at(125, 0.9))
    assert not free(frame, at(BLIND.start - wide + 1.5, 0.9))
    assert not free(frame, at(2, 0.9)), "part of it lies beyond the image"
    assert not free(frame, at(300, 0.9))


def test_nothing_lies_below_the_table(frame):
    table = Plane(np.array([0.0, -1.0, 0.0]), 0.1)
    below = np.array([[0.0, 0.11, 1.2], [0.0, 0.09, 1.2]])
    assert table.signed_distance(below)[0] < 0
    np.testing.assert_array_equal(free(frame, below, table), [True, False])


def test_no_points_are_no_balls(frame):
    assert free(frame, np.zeros((0, 3))).shape == (0,)
