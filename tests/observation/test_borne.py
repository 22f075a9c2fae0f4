"""Which of the large planes bears the things."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from room_scene import TABLE, THINGS, photograph, seen, shelf, up, wall

from brrp_cli.config import ObservationConfig, preset
from brrp_cli.config.observation import SupportConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.geometry import transform_points
from brrp_cli.hulls import in_hull
from brrp_cli.observation.borne import bearing, standing_on
from brrp_cli.observation.patches import (
    Ransac,
    largest_planes,
    patch_of,
    patch_with_hidden,
)
from brrp_cli.observation.ray_samples import scene_plane
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.table_plane import find_table

CONFIG = SupportConfig()
ROLLS = pytest.mark.parametrize(
    "roll", [0.0, np.pi / 2, np.pi], ids=["upright", "on its side", "upside"]
)


@ROLLS
@pytest.mark.parametrize("background", [[TABLE, wall()], shelf()], ids=["before a wall", "shelf"])
def test_things_stand_on_the_board_beneath_them(background, roll):
    frame = photograph(THINGS, background, roll=roll)
    config = ObservationConfig()
    blind = scene_plane(frame, replace(config, support=None), 0)
    assert abs(blind.normal @ up(frame)) < 0.1, "the wall is the largest plane"
    beneath = transform_points(np.linalg.inv(frame.T_world_cam), np.zeros((1, 3)))
    for plane in (
        scene_plane(frame, config, 0),
        find_table(seen(frame), 0, None, SegmentConfig().table).plane,
    ):
        assert plane.normal @ up(frame) > 0.99
        assert abs(plane.signed_distance(beneath)[0]) < 0.01


def test_the_floor_before_a_shelf_bears_nothing():
    """From above it is the largest plane by far."""
    frame = photograph(THINGS, shelf(), elevation=0.45, distance=1.1)
    config = ObservationConfig(plane_radius=2.0)
    blind = scene_plane(frame, replace(config, support=None), 0)
    origin = transform_points(np.linalg.inv(frame.T_world_cam), np.zeros((1, 3)))
    assert blind.signed_distance(origin)[0] == pytest.approx(0.5, abs=0.01)
    table = find_table(seen(frame), 0, None, SegmentConfig().table)
    for plane in (scene_plane(frame, config, 0), table.plane):
        assert plane.signed_distance(origin)[0] == pytest.approx(0.0, abs=0.01)


def test_the_paper_takes_the_largest_plane():
    assert preset("paper").observation.support is None


def square(z: float, size: float, *, step: float = 0.005) -> np.ndarray:
    """Points of a square about the optical axis that a camera above sees, metres."""
    side = np.arange(-size / 2, size / 2, step)
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    return np.stack([x, y, np.full(x.size, z)], axis=-1)


def facing(z: float, points: np.ndarray):
    return patch_of(Plane(np.array([0.0, 0.0, -1.0]), z), points, 0.01, 0.02)


def test_what_is_seen_behind_a_surface_shows_that_it_is_none():
    floor, near = square(1.0, 0.8), square(0.5, 0.2)
    whole = facing(1.0, np.concatenate([floor, near]))
    assert whole.count == len(floor)
    assert whole.seen_through(near, 0.02) == 0
    behind = facing(0.5, near).seen_through(floor, 0.02)
    # Of the floor, twice as far away, what lies behind 0.2 m less 2 cm on each side.
    assert behind == pytest.approx((2 * 0.16 / 0.005) ** 2, rel=0.1)


def test_the_face_of_a_near_thing_is_no_table_however_many_pixels_show_it():
    face = square(0.4, 0.2, step=0.002)
    face[:, 2] += 0.75 * face[:, 1]
    near = patch_of(Plane(np.array([0.0, 0.6, -0.8]), 0.32), face, 0.01, 0.02)
    post = np.array([[x, 0.3, 1.0 - h] for x in np.arange(0.0, 0.3, 0.01) for h in (0.025, 0.1)])

    # It hides what of the table lies behind it.
    floor = square(1.0, 0.8, step=0.01)
    hidden = in_hull(near.hull, near.plan(near.plane.met_by(floor)), 0.0)
    points = np.concatenate([face, floor[~hidden], post])
    patches = [patch_of(near.plane, points, 0.01, 0.02), facing(1.0, points)]
    assert patches[0].count > patches[1].count
    assert bearing(patches, patches[0], points, None, CONFIG) is patches[1]


def test_things_that_go_across_the_image_do_not_part_a_table():
    floor = square(1.0, 0.8)
    # A strip of it lies behind something, 12 cm wide.
    hidden = np.abs(floor[:, 0] - 0.1) < 0.06
    table = np.concatenate([floor[~hidden], 0.8 * floor[hidden]])
    plane = Plane(np.array([0.0, 0.0, -1.0]), 1.0)
    beyond = floor[floor[:, 0] > 0.2]

    def holds(patch):
        return in_hull(patch.hull, patch.plan(beyond), 1e-6)

    assert not holds(patch_of(plane, table, 0.01, 0.02)).any()
    whole = patch_with_hidden(plane, table, 0.01, CONFIG)
    assert holds(whole).all() and whole.count == (~hidden).sum()
    # Where a floor is seen between them, they are two tables.
    two = np.concatenate([floor[~hidden], 1.5 * floor[hidden]])
    assert not holds(patch_with_hidden(plane, two, 0.01, CONFIG)).any()


def test_what_reaches_down_to_a_plane_stands_on_it():
    patch = facing(1.0, square(1.0, 0.8))
    post = np.array([[0.01, 0.01, 1.0 - h] for h in (0.001, 0.1, 0.2)])
    hanging = np.array([[0.1, 0.1, 1.0 - h] for h in (0.1, 0.2)])
    aside = post + [2.0, 0, 0]
    assert standing_on(patch, np.concatenate([post, hanging, aside]), CONFIG) == (1, 3)
    assert standing_on(patch, hanging, CONFIG) == (0, 0)
    assert standing_on(patch, post[:0], CONFIG) == (0, 0)


def test_most_must_stand_on_what_is_large():
    table, board = square(1.0, 1.2), square(0.8, 0.5)
    table = table[np.abs(table[:, :2]).max(axis=1) > 0.25 / 0.8]
    on_board = square(0.78, 0.1)
    points = np.concatenate([table, board, on_board])
    patches = [facing(1.0, table), facing(0.8, board)]
    usual = patches[0]
    small = replace(patches[1], count=int(0.09 * usual.count))
    assert bearing([usual, small], usual, points, on_board, CONFIG) is usual
    assert bearing(patches, usual, points, on_board, CONFIG) is patches[1]
    assert bearing(patches, usual, points, on_board[:1], CONFIG) is usual, "too little"


def test_planes_come_with_the_most_points_first_and_small_ones_are_left():
    rng = np.random.default_rng(0)
    sizes = {1.0: 0.8, 0.7: 0.5, 0.4: 0.1}
    points = np.concatenate([square(z, size) for z, size in sizes.items()])
    points[:, 2] += 0.001 * rng.normal(size=len(points))
    ransac = Ransac(0.01, 200, 2000, 50)
    found = largest_planes(points, 0, CONFIG, ransac)
    assert [round(plane.offset, 2) for plane, _ in found] == [1.0, 0.7]
    only = np.concatenate([square(1.0, 0.8), square(0.7, 0.2)])
    assert len(largest_planes(only, 0, CONFIG, ransac)) == 1, "no second that could be the table"


def test_what_lies_a_little_over_a_board_is_no_board():
    """Books on the lower board, seen before a larger wall that bears nothing."""
    board, books = square(1.0, 0.8), square(0.95, 0.4)
    board = board[np.abs(board[:, :2]).max(axis=1) > 0.2 / 0.95]
    on_books = square(0.93, 0.3)
    wall = square(1.0, 1.2)[:, [2, 1, 0]] * [-0.7, 1, 1] + [0, 0, 0.8]
    points = np.concatenate([board, books, on_books, wall])
    upright = patch_of(Plane(np.array([1.0, 0.0, 0.0]), 0.7), wall, 0.01, 0.02)
    patches = [upright, facing(1.0, board), facing(0.95, books)]
    assert upright.count > patches[1].count > patches[2].count
    things = np.concatenate([on_books, books])
    assert bearing(patches, upright, points, things, CONFIG) is not patches[2]
    assert bearing([upright, patches[2]], upright, points, things, CONFIG) is patches[2]
