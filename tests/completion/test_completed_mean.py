"""Which space an object that no stored one explains cannot be in."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.completion.completed_mean import empty_space
from brrp_cli.config import MeanConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.observation.support_plane import Plane

CONFIG = MeanConfig()
K = np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]])

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
