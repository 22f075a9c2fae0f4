"""Whether what is seen of a thing tells that it hangs, from above and from the side."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import T_WORLD_CAM, K, in_camera, photograph

from brrp_cli.config.segmentation import LeftOutConfig
from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.build import make_frame
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.beneath import bare_beneath, hides_its_foot
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
def test_below_what_stands_no_table_is_seen(pose):
    frame, plane = seen(pose)
    mask = frame.segmap == 1
    assert bare_beneath(mask, frame, plane, CONFIG) < 0.01
    assert hides_its_foot(mask, frame, plane, np.ones_like(mask), CONFIG)


def test_below_what_hangs_the_table_is_seen():
    frame, plane = seen(T_WORLD_CAM, lifted=0.2)
    mask = frame.segmap == 1
    assert bare_beneath(mask, frame, plane, CONFIG) > 0.9
    assert not hides_its_foot(mask, frame, plane, np.ones_like(mask), CONFIG)


def test_what_is_not_over_the_table_has_no_foot_there():
    frame, plane = seen(FROM_ABOVE)
    mask = frame.segmap == 1
    assert not hides_its_foot(mask, frame, plane, np.zeros_like(mask), CONFIG)


def test_where_nothing_is_known_below_nothing_speaks_for_a_foot():
    frame, plane = seen(T_WORLD_CAM, lifted=0.2)
    mask = frame.segmap == 1
    depth = np.where(mask, frame.depth, 0.0)
    alone = make_frame(depth=depth, K=K)
    assert bare_beneath(mask, alone, plane, CONFIG) == 1.0


def test_a_tall_box_that_is_seen_from_above_is_found():
    frame, _ = seen(FROM_ABOVE)
    found = segment(make_frame(rgb=frame.rgb, depth=frame.depth, K=K))
    mask = frame.segmap == 1
    assert found.max() == 1
    assert ((found == 1) & mask).sum() > 0.8 * ((found == 1) | mask).sum()
