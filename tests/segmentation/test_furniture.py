"""What shuts a table off, as solids."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from room_scene import BOARD, HEIGHT, TABLE, THINGS, photograph, shelf, up, wall

from brrp_cli.config import ObservationConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.geometry import transform_points
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.support_plane import Plane
from brrp_cli.raycast import raycasting_scene
from brrp_cli.segmentation.furniture import Furniture, furniture, segmentation_of

CONFIG = SegmentConfig()


def table_of(frame):
    return scene_plane(frame, ObservationConfig(), 0)


def around(frame):
    return furniture(frame, table_of(frame), 0, CONFIG)


def in_world(frame, solid):
    return transform_points(frame.T_world_cam, solid)


@pytest.mark.parametrize("elevation", [0.25, 0.5], ids=["from before", "from above"])
def test_a_shelf_has_a_slab_behind_each_face_that_is_seen(elevation):
    boards = shelf()[:-1]
    frame = photograph(THINGS, shelf(), elevation=elevation, distance=0.9)
    found = around(frame)
    assert found.bins == [] and len(found.walls) >= 3
    true = raycasting_scene(boards)
    for solid in found.walls:
        corners = in_world(frame, solid)
        face, back = np.split(corners, 2)
        # Within the outline: its ends may reach past the end of a board.
        inner = face.mean(axis=0) + 0.8 * (face - face.mean(axis=0))
        off = true.compute_distance(inner.astype(np.float32)).numpy()
        assert off.max() < 0.006
        thick = np.linalg.norm(face - back, axis=1)
        np.testing.assert_allclose(thick, CONFIG.table.wall.thick, atol=1e-6)
        middle = (0.5 * (face + back)).mean(axis=0).astype(np.float32)[None]
        assert true.compute_signed_distance(middle).numpy() < 0, "it lies in the board"
    # From before it to the things.
    way_in = np.linspace([0.4, 0.0, 0.1], [0.05, 0.0, 0.1], 50)
    solids = [trimesh.convex.convex_hull(in_world(frame, each)) for each in found.walls]
    open_front = raycasting_scene(solids).compute_signed_distance(way_in.astype(np.float32))
    assert open_front.numpy().min() > 0.02


def test_the_upper_board_is_one_of_them():
    frame = photograph(THINGS, shelf(), elevation=0.5, distance=0.9)
    highest = max(in_world(frame, solid)[:, 2].max() for solid in around(frame).walls)
    assert highest == pytest.approx(HEIGHT + BOARD, abs=0.012)


def test_a_wall_is_a_slab_and_none_where_it_has_a_mask():
    frame = photograph(THINGS, [TABLE, wall()])
    (solid,) = around(frame).walls
    assert len(solid) == 8
    plane = table_of(frame)
    rises = (plane.signed_distance(frame.points) > 0.02) & (frame.segmap == 0) & frame.valid
    whole = replace(frame, segmap=np.where(rises, 7, frame.segmap))
    assert furniture(whole, plane, 0, CONFIG).walls == []


def test_where_things_stand_elsewhere_nothing_is_known():
    frame = photograph(THINGS, [TABLE, wall()])
    plane = table_of(frame)
    lower = Plane(plane.normal, plane.offset + 0.1)
    assert furniture(frame, lower, 0, CONFIG) == Furniture()
    assert furniture(frame, None, 0, CONFIG) == Furniture()
    assert plane.normal @ up(frame) > 0.99


def test_solids_move_with_the_frame():
    one = np.arange(24.0).reshape(8, 3)
    T = np.eye(4)
    T[:3, 3] = 1, 2, 3
    moved = Furniture([[one]], [one + 1]).moved(T)
    np.testing.assert_allclose(moved.solids, [one + [1, 2, 3], one + [2, 3, 4]])


def test_results_of_another_version_are_looked_at_with_the_defaults(caplog):
    with caplog.at_level(logging.WARNING):
        found = segmentation_of({"table": {"of_a_former_version": 3}})
    assert found == CONFIG and "of_a_former_version" in caplog.text
