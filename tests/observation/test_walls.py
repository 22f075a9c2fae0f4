"""What shuts a table off: walls behind it, the sides and the upper board of a shelf."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from room_scene import HEIGHT, TABLE, THINGS, YAW, photograph, seen, shelf, turned, up, wall

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.observation.patches import Patch, patch_of
from brrp_cli.observation.support_plane import Plane
from brrp_cli.observation.walls import Wall, walls_of
from brrp_cli.segmentation.segment import segment
from brrp_cli.segmentation.table_plane import find_table

CONFIG = SegmentConfig()


def table_of(frame):
    return find_table(seen(frame), 0, None, CONFIG.table)


def agreement(frame, config=CONFIG):
    """Of masks with all true ones, as one."""
    things = frame.segmap > 0
    try:
        found = segment(frame, config=config) > 0
    except FrameError:
        return 0.0
    return float((found & things).sum() / (found | things).sum())


def test_a_wall_ends_the_table():
    frame = photograph(THINGS, [TABLE, wall()])
    (back,) = table_of(frame).walls
    assert back.spans and not back.outside
    assert abs(back.patch.plane.normal @ up(frame)) < 0.1
    assert agreement(frame) > 0.85


def test_a_shelf_has_a_back_and_sides():
    frame = photograph(THINGS, shelf(), elevation=0.25, distance=0.9)
    table = table_of(frame)
    across = np.linalg.inv(frame.T_world_cam)[:3, :3] @ [-np.sin(YAW), np.cos(YAW), 0]
    inner = [each for each in table.walls if not each.outside]
    facing = [round(float(each.patch.plane.normal @ across)) for each in inner]
    assert sorted(facing) == [-1, 0, 1] and all(each.spans for each in inner)


@pytest.mark.parametrize(
    ("elevation", "lower"), [(0.05, HEIGHT), (0.6, HEIGHT + 0.02 - CONFIG.table.wall.board)]
)
def test_the_next_board_is_seen_from_below_or_from_above(elevation, lower):
    frame = photograph(THINGS, shelf(), elevation=elevation, distance=0.9)
    board = table_of(frame).board
    assert board is not None and board.height == pytest.approx(lower, abs=0.01)


def test_the_outside_of_a_shelf_is_no_thing():
    frame = photograph(THINGS, shelf(YAW + 0.6), elevation=0.25, distance=0.9)
    table = table_of(frame)
    (outer,) = [each for each in table.walls if each.outside]
    found = segment(frame)
    assert not (found[outer.holds(frame.points, 0.005)] > 0).any()
    for thing in (1, 2):
        mask = frame.segmap == thing
        best = np.bincount(found[mask])[1:].argmax() + 1
        assert (mask & (found == best)).sum() > 0.8 * (mask | (found == best)).sum()


def test_front_edges_are_no_wall():
    """Else they would cut what reaches through them."""
    frame = photograph(THINGS, shelf(), elevation=0.25, distance=0.9)
    forth = np.linalg.inv(frame.T_world_cam)[:3, :3] @ [np.cos(YAW), np.sin(YAW), 0]
    for each in table_of(frame).walls:
        middle = each.patch.plane.normal @ forth
        assert middle < 0.1 or not each.outside


@pytest.mark.parametrize("roll", [0.0, np.pi], ids=["upright", "upside"])
@pytest.mark.parametrize("elevation", [0.2, 0.4])
def test_masks_in_a_shelf_are_those_of_the_things(elevation, roll):
    frame = photograph(THINGS, shelf(), elevation=elevation, roll=roll, distance=0.7)
    assert agreement(frame) > 0.8


def test_what_is_near_a_wall_or_behind_it_is_no_thing():
    plane = Plane(np.array([0.0, 0.0, -1.0]), 2.0)
    patch = Patch(plane, np.eye(3)[:2], np.zeros((0, 3)), 0, 0.0)
    depths = np.array([1.9, 1.95, 1.96, 2.0, 2.3])
    points = np.stack([0 * depths, 0 * depths, depths], axis=-1)
    inner, outer = (Wall(patch, outside, True) for outside in (False, True))
    assert inner.holds(points, 0.012).tolist() == [False, False, True, True, True]
    assert outer.holds(points, 0.012).tolist() == [False, False, True, True, False]


def test_a_box_that_ends_the_table_has_a_mask_all_the_same():
    """Its front looks like a wall in all but that it ends within the image and before the table."""
    last = turned(trimesh.creation.box((0.05, 0.2, 0.16)).apply_translation([-0.12, 0, 0.08]))
    ends = turned(trimesh.creation.box((0.8, 1.5, 0.02)).apply_translation([0.28, 0, -0.01]))
    frame = photograph([last, *THINGS], [ends], elevation=0.5)
    assert not any(each.spans for each in table_of(frame).walls)
    found, mask = segment(frame), frame.segmap == 1
    ids, counts = np.unique(found[mask], return_counts=True)
    assert ids[np.argmax(counts)] > 0 and counts.max() > 0.8 * mask.sum()


def test_the_side_of_a_large_box_is_no_wall_and_its_lid_no_board():
    """It fills more of the image than the table, which goes on behind it."""
    box = turned(trimesh.creation.box((0.12, 0.3, 0.3)).apply_translation([0.0, 0.0, 0.15]))
    frame = photograph([], [TABLE, box, *THINGS], elevation=0.5)
    table = table_of(frame)
    assert table.plane.normal @ up(frame) > 0.99
    assert table.walls == () and table.board is None


@pytest.mark.parametrize(("wide", "spans"), [(0.3, False), (0.6, True)])
def test_the_face_of_a_thing_is_shorter_than_a_wall(wide, spans):
    """Also where it goes along all of the table that is seen."""
    side = np.arange(-wide / 2, wide / 2, 0.005)
    depth, height = np.arange(0, 0.15, 0.005), np.arange(0.005, 0.2, 0.005)
    flat = np.stack([*np.meshgrid(side, depth + 0.005), np.zeros((len(depth), len(side)))], axis=-1)
    rising = np.stack([*np.meshgrid(side, height), np.zeros((len(height), len(side)))], axis=-1)[
        ..., [0, 2, 1]
    ]
    points = np.concatenate([flat.reshape(-1, 3), rising.reshape(-1, 3)]) + [0, -0.5, -0.5]
    table, back = (
        patch_of(Plane(np.array(normal), 0.5), points, 0.002, 0.02)
        for normal in ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    )
    (found,) = walls_of(table, [table, back], points, CONFIG.table.wall, CONFIG.table.support)
    assert found.patch is back and found.spans == spans
