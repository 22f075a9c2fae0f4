"""A wall behind a table, from low cameras to which it is the larger plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from brrp_cli.config import ObservationConfig, preset
from brrp_cli.config.observation import WallConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.demo.layout import camera_pose
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, transform_points
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.support_plane import Plane
from brrp_cli.observation.walls import behind_wall, is_wall, touching
from brrp_cli.raycast import look
from brrp_cli.segmentation.segment import segment
from brrp_cli.segmentation.table_plane import find_table

H, W = 240, 320
K = np.array([[300.0, 0, W / 2], [0, 300.0, H / 2], [0, 0, 1]])
TABLE = trimesh.creation.box((3.0, 3.0, 0.02)).apply_translation([0, 0, -0.01])
YAW = 0.3
THINGS = [
    trimesh.creation.box((0.08, 0.06, 0.1)).apply_translation([0.0, -0.1, 0.05]),
    trimesh.creation.cylinder(0.03, 0.12).apply_translation([0.05, 0.08, 0.06]),
]


def wall(behind=0.2):
    """Square to the line of sight of a camera at `YAW`."""
    box = trimesh.creation.box((0.02, 4.0, 1.6)).apply_translation([-behind, 0, 0.8])
    return box.apply_transform(trimesh.transformations.rotation_matrix(YAW, [0, 0, 1]))


def photograph(meshes, background, elevation=0.15, roll=0.0, distance=0.55) -> Frame:
    """A frame of things, ids 1, 2, ..., and of background, with a sensor's noise."""
    T_world_cam = camera_pose(np.array([0.0, 0.0, 0.05]), distance, elevation, YAW)
    turned = trimesh.transformations.rotation_matrix(roll, [0, 0, 1])
    T_cam_world = np.linalg.inv(T_world_cam @ turned)
    solid = [mesh.copy().apply_transform(T_cam_world) for mesh in [*meshes, *background]]
    sight = look(solid, K, (H, W))
    rng = np.random.default_rng(0)
    depth = sight.depth * (1 + 0.001 * rng.normal(size=(H, W)))
    ids = np.where((sight.index >= 0) & (sight.index < len(meshes)), sight.index + 1, 0)
    rgb = np.full((H, W, 3), 120, np.uint8)
    rgb[ids > 0] = (180, 60, 50)
    return Frame(rgb, backproject(depth, K), ids.astype(np.int64), K, T_world_cam @ turned)


def up(frame):
    """The table's normal, in the camera's frame."""
    return np.linalg.inv(frame.T_world_cam)[:3, :3] @ [0, 0, 1]


def seen(frame):
    return frame.points[frame.valid].astype(np.float64)


@pytest.mark.parametrize("roll", [0.0, np.pi / 2, np.pi], ids=["upright", "on its side", "upside"])
def test_things_stand_on_the_table_and_not_on_the_larger_wall(roll):
    frame = photograph(THINGS, [TABLE, wall()], roll=roll)
    config = ObservationConfig()
    blind = scene_plane(frame, replace(config, wall=None), 0)
    assert abs(blind.normal @ up(frame)) < 0.1, "the wall is the larger plane"
    assert scene_plane(frame, config, 0).normal @ up(frame) > 0.99
    table = find_table(seen(frame), 0, None, SegmentConfig().table)
    assert table.plane.normal @ up(frame) > 0.99
    (back,) = table.backs
    assert abs(back.normal @ up(frame)) < 0.1


def test_the_paper_knows_no_walls():
    assert preset("paper").observation.wall is None


def test_masks_are_those_of_the_things_and_the_wall_has_none():
    frame = photograph(THINGS, [TABLE, wall()])
    things = frame.segmap > 0

    def agrees(config):
        try:
            found = segment(frame, config=config) > 0
        except FrameError:
            return 0.0
        return float((found & things).sum() / (found | things).sum())

    assert agrees(SegmentConfig()) > 0.85
    # A table that would have to be as large as the wall is none.
    blind = replace(SegmentConfig().table, wall=WallConfig(of_wall=1.0))
    assert agrees(SegmentConfig(table=blind)) < 0.7


def test_what_is_near_a_wall_or_behind_it_is_no_thing():
    wall = Plane(np.array([0.0, 0.0, -1.0]), 2.0)
    depths = np.array([1.9, 1.95, 1.96, 2.0, 2.3])
    points = np.stack([0 * depths, 0 * depths, depths], axis=-1)
    assert behind_wall(points, wall, 0.012).tolist() == [False, False, True, True, True]


def test_a_box_that_ends_the_table_has_a_mask_all_the_same():
    """Its front looks like a wall in all but that it ends within the image."""
    last = trimesh.creation.box((0.05, 0.2, 0.16)).apply_translation([-0.12, 0, 0.08])
    last.apply_transform(trimesh.transformations.rotation_matrix(YAW, [0, 0, 1]))
    ends = trimesh.creation.box((0.8, 1.5, 0.02)).apply_translation([0.28, 0, -0.01])
    ends.apply_transform(trimesh.transformations.rotation_matrix(YAW, [0, 0, 1]))
    frame = photograph([last, *THINGS], [ends], elevation=0.5)
    table = find_table(seen(frame), 0, None, SegmentConfig().table)
    assert len(table.backs) == 1
    found, mask = segment(frame), frame.segmap == 1
    ids, counts = np.unique(found[mask], return_counts=True)
    assert ids[np.argmax(counts)] > 0 and counts.max() > 0.8 * mask.sum()


def test_the_side_of_a_large_box_is_no_wall():
    """It fills more of the image than the table, which goes on behind it."""
    box = trimesh.creation.box((0.12, 0.3, 0.3)).apply_translation([0.0, 0.0, 0.15])
    box.apply_transform(trimesh.transformations.rotation_matrix(YAW, [0, 0, 1]))
    frame = photograph([], [TABLE, box, *THINGS], elevation=0.5)
    normal = np.linalg.inv(frame.T_world_cam)[:3, :3] @ [np.cos(YAW), np.sin(YAW), 0]
    middle = transform_points(
        np.linalg.inv(frame.T_world_cam), np.array([[0.06 * np.cos(YAW), 0.06 * np.sin(YAW), 0.1]])
    )[0]
    side = Plane(normal, float(-normal @ middle))
    table = find_table(seen(frame), 0, None, SegmentConfig().table).plane
    assert table.normal @ up(frame) > 0.99
    assert not is_wall(side, table, seen(frame), seen(frame), WallConfig())
    assert not is_wall(table, side, seen(frame), seen(frame), WallConfig())


def test_what_lies_over_each_cell_touches_a_plane_or_does_not():
    floor = Plane(np.array([0.0, 0.0, 1.0]), 0.0)
    config = WallConfig()
    standing = np.array([[0.01, 0.01, 0.0], [0.01, 0.01, 0.2], [0.05, 0.01, 0.1]])
    assert touching(floor, standing, config) == 0.5
    assert touching(floor, standing[2:], config) == 0.0
    assert touching(floor, standing[:0], config) == 0.0
