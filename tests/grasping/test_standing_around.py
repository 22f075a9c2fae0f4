"""What stands around objects and is none of them, which a hand keeps out of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import room_scene
import trimesh
from table_scene import T_CAM_WORLD, TABLE, in_camera, photograph

from brrp_cli.config.grasping import SurroundingsConfig
from brrp_cli.config.segmentation import SegmentConfig, SmoothDepthConfig
from brrp_cli.grasping.standing_around import standing_around
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.reaching_in import arms_in
from brrp_cli.shapes import solids

CONFIG = SurroundingsConfig()
BOX = in_camera(solids.box(0.06, 0.06, 0.08), T_CAM_WORLD)


def around(*others, plane=TABLE):
    """The points around a box of which the others, at world places, have no mask."""
    meshes = {number: in_camera(other, T_CAM_WORLD) for number, other in enumerate(others, 7)}
    seen = photograph({1: BOX, **meshes})
    seen = replace(seen, segmap=np.where(seen.segmap > 1, 0, seen.segmap))
    return standing_around(seen, plane, seen.object_points(1), CONFIG, SmoothDepthConfig())


def test_a_wall_beside_an_object_is_found_where_it_is():
    wall = solids.moved(solids.box(0.3, 0.01, 0.15), y=0.12)
    points = around(wall)
    assert len(points) > 50
    height = TABLE.signed_distance(points)
    assert height.min() > CONFIG.rises - 0.005 and height.max() < 0.152
    world = points @ T_CAM_WORLD[:3, :3] - T_CAM_WORLD[:3, :3].T @ T_CAM_WORLD[:3, 3]
    assert (np.abs(world[:, 1] - 0.12) < 0.008).all()


def test_an_object_alone_has_nothing_around_it():
    assert len(around()) == 0


def test_what_is_far_flat_or_close_by_is_not_around_it():
    far = solids.moved(solids.box(0.05, 0.05, 0.1), x=-0.1, y=0.4)
    flat = solids.moved(solids.box(0.1, 0.1, 0.012), y=0.15)
    bled = solids.moved(solids.box(0.06, 0.01, 0.06), y=0.038)
    assert len(around(far, flat, bled)) == 0


def test_what_is_an_arm_is_not_around_it():
    """The arm goes from above the box to beyond the image."""
    meshes = [solids.moved(solids.box(0.06, 0.06, 0.08), z=0)]
    reach = trimesh.creation.cylinder(0.035, segment=[(0.0, 0.0, 0.2), (-0.5, 0.6, 0.4)])
    frame = room_scene.photograph([*meshes, reach], [room_scene.TABLE], elevation=0.6, distance=0.7)
    plane = Plane(*_plane(frame))
    frame = replace(frame, segmap=np.where(frame.segmap > 1, 0, frame.segmap))
    known = frame.object_points(1)
    arms = arms_in(frame, 0, SegmentConfig())
    seen = (frame, plane, known, CONFIG, SmoothDepthConfig())
    assert len(standing_around(*seen)) > 50
    assert len(standing_around(*seen, arms)) < 5


def _plane(frame):
    normal = room_scene.up(frame)
    foot = np.linalg.inv(frame.T_world_cam)[:3, 3]
    return normal, -float(normal @ foot)


def test_without_a_table_nothing_is_told():
    assert len(around(solids.moved(solids.box(0.3, 0.01, 0.15), y=0.12), plane=None)) == 0
