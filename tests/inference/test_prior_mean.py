"""Prior means on grids: where the nodes are, what lies between, what cannot be in an object."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from brrp_cli.inference.prior_mean import (
    PriorMeanGrid,
    empty_space,
    grid_over,
    shape_logits,
)

from brrp_cli.config import MeanConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.observation.support_plane import Plane

CONFIG = MeanConfig()
K = np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]])
BOX = np.array([[-0.1, 0.2, 1.0], [0.1, 0.25, 1.4]])


def random_lattice():
    values = np.random.default_rng(0).normal(size=(2, 4, 5, 6)).astype(np.float16)
    return PriorMeanGrid(np.array([0.3, -0.2, 1.0]), 0.01, values, outside=-5.0)


@pytest.mark.parametrize("nodes", [1000, 100_000])
def test_the_lattice_covers_the_box_with_about_as_many_nodes_as_asked(nodes):
    lower, spacing, grid = grid_over(BOX, replace(CONFIG, nodes=nodes))
    np.testing.assert_array_equal(lower, BOX[0])
    np.testing.assert_array_equal(grid[0, 0, 0], BOX[0])
    assert (grid[-1, -1, -1] >= BOX[1] - 1e-9).all()
    assert (grid[-1, -1, -1] < BOX[1] + spacing).all(), "no layer more than it takes"
    steps = [np.diff(grid[..., axis], axis=axis) for axis in range(3)]
    for step in steps:
        np.testing.assert_allclose(step, spacing, atol=1e-12)
    # The last layer of each axis is on top of what was asked.
    assert nodes <= grid[..., 0].size < nodes * np.prod(1 + 2 * spacing / (BOX[1] - BOX[0]))


def test_the_upper_corner_is_the_last_node():
    np.testing.assert_allclose(random_lattice().upper, [0.33, -0.16, 1.05])


def test_at_the_nodes_the_logits_stand_as_they_are():
    grid = random_lattice()
    index = np.array([[0, 0, 0], [3, 4, 5], [1, 2, 3], [2, 0, 5]])
    # The grid ends with its last nodes: rounding must not put these outside.
    within = np.clip(index, 1e-6, np.array([3, 4, 5]) - 1e-6)
    found = grid.logits(grid.lower + grid.spacing * within)
    np.testing.assert_allclose(found, grid.values[(slice(None), *index.T)], atol=1e-5)
    assert found.shape == (2, 4) and found.dtype == np.float32


def test_between_the_nodes_a_trilinear_function_is_itself():
    grid = random_lattice()

    def function(p):
        x, y, z = ((p - grid.lower) / grid.spacing).T
        return 1 + x - 2 * y + z + x * y * z / 8

    nodes = np.stack(np.meshgrid(*map(np.arange, (4, 5, 6)), indexing="ij"), axis=-1)
    values = function(grid.lower + grid.spacing * nodes.reshape(-1, 3)).reshape(1, 4, 5, 6)
    exact = replace(grid, values=values.astype(np.float32))
    points = np.random.default_rng(1).uniform(grid.lower, grid.upper, (200, 3))
    np.testing.assert_allclose(exact.logits(points)[0], function(points), atol=1e-4)


def test_off_the_lattice_everything_is_the_outside():
    grid = random_lattice()
    far = np.array([[0.0, 0, 0], [0.34, -0.18, 1.02], [0.31, -0.18, 0.9], [9, 9, 9]])
    np.testing.assert_array_equal(grid.logits(far), np.full((2, 4), -5.0))


def test_the_volume_equals_the_points():
    grid = random_lattice()
    axes = (np.linspace(0.28, 0.34, 5), np.linspace(-0.2, -0.15, 6), np.linspace(1.0, 1.05, 7))
    volume = grid.volume(axes)
    assert volume.shape == (2, 5, 6, 7)
    for i, j, k in [(1, 2, 3), (4, 0, 6), (2, 5, 1)]:
        point = np.array([[axes[0][i], axes[1][j], axes[2][k]]])
        np.testing.assert_array_equal(volume[:, i, j, k], grid.logits(point)[:, 0])


def test_a_placed_shape_is_even_where_it_ends_and_sure_far_from_there():
    distance = np.array([-0.5, CONFIG.growth, CONFIG.growth + CONFIG.width, 0.5])
    expected = [CONFIG.limit, 0, -1, -CONFIG.limit]
    np.testing.assert_allclose(shape_logits(distance, CONFIG.sure, CONFIG), expected, atol=1e-9)
    np.testing.assert_allclose(shape_logits(distance, 1.0, CONFIG), expected, atol=1e-9)


def test_less_evidence_makes_a_softer_surface_in_the_same_place():
    near = CONFIG.growth + np.array([-0.002, 0.0, 0.002])
    found = [
        shape_logits(near, alignment_score, CONFIG) for alignment_score in (0.85, 0.6, 0.2, -1.0)
    ]
    for sharp, soft in pairwise(found):
        assert sharp[0] > soft[0] > 0 > soft[2] > sharp[2]
        assert sharp[1] == soft[1] == 0
    # Half a unit below `sure` adds half of `doubt` to the width.
    width = CONFIG.width + CONFIG.doubt / 2
    assert shape_logits(near, CONFIG.sure - 0.5, CONFIG)[2] == pytest.approx(-0.002 / width)


# An image of 80 x 100: a wall at 2 m, object 1 at 1 m in columns 40 to 49, object 2 at 1 m in
# columns 70 to 79; a hole at column 20.
OWN, OTHER = 1, 2


@pytest.fixture(scope="module")
def frame():
    depth = np.full((80, 100), 2.0)
    segmap = np.zeros((80, 100), np.int64)
    for object_id, start in ((OWN, 40), (OTHER, 70)):
        segmap[20:60, start : start + 10] = object_id
        depth[20:60, start : start + 10] = 1.0
    depth[:, 20] = np.nan
    return Frame(np.zeros((80, 100, 3), np.uint8), backproject(depth, K), segmap, K)


def at(column, z, row=40):
    """The point at depth z that the camera sees in a pixel."""
    return [(column - 50) / 100 * z, (row - 40) / 100 * z, z]


@pytest.mark.parametrize(
    ("point", "empty", "why"),
    [
        (at(45, 0.9), True, "in front of the object"),
        (at(45, 0.99), True, "1 cm in front of it"),
        (at(45, 0.996), False, "in front of it by less than depth is trusted"),
        (at(45, 1.05), False, "behind what was seen of it"),
        (at(10, 1.0), True, "in front of the wall"),
        (at(10, 2.005), True, "in the wall's surface, beside the mask"),
        (at(10, 2.05), False, "behind the wall"),
        (at(75, 0.9), True, "in front of another object"),
        (at(75, 1.005), False, "in another object, which may hide this one"),
        (at(75, 1.5), False, "behind another object"),
        (at(51, 2.005), False, "close to the mask: masks are not that exact"),
        (at(53, 2.005), True, "further from the mask than that"),
        (at(20, 1.0), False, "where nothing was measured"),
        (at(-30, 1.0), False, "outside of the image"),
        ([0.0, 0.0, -1.0], False, "behind the camera"),
    ],
)
def test_what_cannot_be_in_the_object_is_empty(frame, point, empty, why):
    assert empty_space(np.array([point]), frame, OWN, None, CONFIG)[0] == empty, why


def test_space_below_the_plane_is_empty_whether_seen_or_not(frame):
    """A table at y = 0.3 (down), the objects' side up."""
    plane = Plane(np.array([0.0, -1.0, 0.0]), 0.3)
    points = np.array([[0.0, 0.31, -1.0], [0, 0.303, -1], [0, 0.29, -1], [-0.05, 0.2, 1.5]])
    found = empty_space(points, frame, OWN, plane, CONFIG)
    np.testing.assert_array_equal(found, [True, False, False, False])
    assert not empty_space(points, frame, OWN, None, CONFIG).any()
