"""Masks of a camera that hangs upside down, or lies on its side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, transform_points
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.cut import boundary_of
from brrp_cli.segmentation.segment import segment, segment_and_aside
from brrp_cli.segmentation.upright import quarter_turns, turned, turned_back, turned_camera

CONFIG = SegmentConfig()


@pytest.fixture(scope="module")
def frame(scene) -> Frame:
    return make_frame(rgb=scene.rgb, segmap=scene.segmap, depth=scene.depth, K=scene.K)


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_a_turned_frame_is_what_a_turned_camera_sees(frame: Frame, turns: int) -> None:
    lying = turned(frame, turns)
    np.testing.assert_allclose(lying.points, backproject(lying.depth, lying.K), atol=1e-5)
    there = transform_points(turned_camera(turns), frame.points.reshape(-1, 3).astype(float))
    back = np.stack([turned_back(each, turns) for each in np.moveaxis(lying.points, -1, 0)], -1)
    np.testing.assert_allclose(back.reshape(-1, 3), there, atol=1e-6)
    for image, other in ((frame.depth, lying.depth), (frame.segmap, lying.segmap)):
        np.testing.assert_array_equal(turned_back(other, turns), image)
    whole = turned(lying, 4 - turns)
    np.testing.assert_array_equal(whole.rgb, frame.rgb)
    np.testing.assert_array_equal(whole.points, frame.points)
    np.testing.assert_allclose(whole.K, frame.K)


@pytest.mark.parametrize(
    ("up", "turns"),
    [((0, -1), 0), ((1, 0), 1), ((0, 1), 2), ((-1, 0), 3), ((0.6, -0.8), 0), ((0.8, -0.6), 1)],
)
def test_the_tables_upper_side_is_turned_up(up: tuple[float, float], turns: int) -> None:
    normal = np.array([*(0.7 * np.array(up)), -np.sqrt(0.51)])
    assert quarter_turns(Plane(normal, 1.0), CONFIG) == turns
    # From right above, no side of the image is the upper one.
    steep = np.array([*(0.2 * np.array(up)), -np.sqrt(0.96)])
    assert quarter_turns(Plane(steep, 1.0), CONFIG) == 0


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_masks_and_borders_are_those_of_the_upright_frame(frame: Frame, turns: int) -> None:
    masks, lying = segment(frame), turned(frame, turns)
    found, aside = segment_and_aside(lying)
    assert found.shape == aside.shape == lying.shape
    back = turned_back(found, turns)
    assert found.max() == masks.max() == 3
    for number in (1, 2, 3):
        mine = back == np.bincount(back[masks == number]).argmax()
        assert (mine & (masks == number)).sum() > 0.95 * (mine | (masks == number)).sum()
    middles = [np.nonzero(found == number)[1].mean() for number in (1, 2, 3)]
    assert middles == sorted(middles), "from left to right in the image as it is"
    border = turned_back(boundary_of(lying, 0, CONFIG), turns)
    apart = np.abs(border - boundary_of(frame, 0, CONFIG))
    assert (apart < 0.05).mean() > 0.99


def test_an_upright_frame_is_not_turned(frame: Frame) -> None:
    never = replace(CONFIG, steep=90.0)
    np.testing.assert_array_equal(segment(frame), segment(frame, config=never))
