"""Whether what is seen of a thing tells that it hangs, from above and from the side."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import T_WORLD_CAM, K, in_camera, photograph

from brrp_cli.config.segmentation import LeftOutConfig
from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.build import make_frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.beneath import hidden_by_itself, hides_its_foot
from brrp_cli.segmentation.segment import segment
from brrp_cli.shapes import solids

CONFIG = LeftOutConfig()
FROM_ABOVE = camera_pose(np.array([0.0, 0.0, 0.03]), 0.7, 1.5, 0.4)


def seen(T_world_cam, lifted=0.0):
    """A box of 10 x 8 x 12 cm, so far above the table, and the table."""
    T_cam_world = np.linalg.inv(T_world_cam)
    box = solids.moved(solids.box(0.10, 0.08, 0.12), z=lifted)
    frame = photograph({1: in_camera(box, T_cam_world)}, T_world_cam=T_world_cam)
    normal = T_cam_world[:3, 2]
    return frame, Plane(normal, float(-normal @ T_cam_world[:3, 3]))


@pytest.mark.parametrize("pose", [FROM_ABOVE, T_WORLD_CAM], ids=["above", "side"])
def test_what_stands_hides_its_own_foot(pose):
    frame, plane = seen(pose)
    mask = frame.segmap == 1
    assert hidden_by_itself(mask, frame, plane, CONFIG) > 0.99
    assert hides_its_foot(mask, frame, plane, np.ones_like(mask), CONFIG)


@pytest.mark.parametrize(("pose", "hidden"), [(FROM_ABOVE, True), (T_WORLD_CAM, False)])
def test_what_hangs_hides_what_is_below_it_from_above_alone(pose, hidden):
    frame, plane = seen(pose, lifted=0.2)
    mask = frame.segmap == 1
    assert hides_its_foot(mask, frame, plane, np.ones_like(mask), CONFIG) == hidden
    assert hidden or hidden_by_itself(mask, frame, plane, CONFIG) < 0.1


def test_the_upper_part_of_a_thing_hides_no_foot():
    frame, plane = seen(T_WORLD_CAM)
    mask = frame.segmap == 1
    upper = mask & (plane.signed_distance(frame.points) > 0.08)
    assert upper.sum() > 300
    assert not hides_its_foot(upper, frame, plane, np.ones_like(mask), CONFIG)


def test_what_is_not_over_the_table_has_no_foot_there():
    frame, plane = seen(FROM_ABOVE)
    mask = frame.segmap == 1
    assert not hides_its_foot(mask, frame, plane, np.zeros_like(mask), CONFIG)


def test_a_tall_box_that_is_seen_from_above_is_found():
    frame, _ = seen(FROM_ABOVE)
    found = segment(make_frame(rgb=frame.rgb, depth=frame.depth, K=K))
    mask = frame.segmap == 1
    assert found.max() == 1
    assert ((found == 1) & mask).sum() > 0.8 * ((found == 1) | mask).sum()
