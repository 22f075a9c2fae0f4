"""Bins on a table: found where they are, and what lies in them, on them and beside them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from bin_scene import (
    FLOOR,
    HEIGHT,
    LENGTH,
    T_WORLD_CAM,
    WALL,
    WIDTH,
    YAW,
    bin_mesh,
    seen,
    standing,
)

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import similarity, transform_points, turn_about_z
from brrp_cli.segmentation.bins import find_bins
from brrp_cli.segmentation.plan_cells import plan_cells
from brrp_cli.segmentation.platforms import find_platforms
from brrp_cli.segmentation.rectangles import rectangles
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces, see_surfaces
from brrp_cli.segmentation.segment import segment
from brrp_cli.shapes import solids

CONFIG = SegmentConfig()


def surfaces(frame: Frame) -> SeenSurfaces:
    return see_surfaces(frame, 0, CONFIG)


def overlap(first, second):
    return (first & second).sum() / (first | second).sum()


def found_as(found: np.ndarray, truth: np.ndarray) -> float:
    """The best overlap of a mask with the true one."""
    return max(overlap(found == i, truth) for i in np.unique(found[found > 0]))


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_bin_is_found_with_its_floor_and_its_rim(noise):
    frame = seen(standing((0.08, 0.06, 0.07), 0.05, 0.02), noise=noise)
    table = surfaces(frame).table
    (one,) = table.bins
    assert one.rim == pytest.approx(HEIGHT, abs=0.006)
    assert one.floor == pytest.approx(FLOOR, abs=0.003 if noise else 0.001)
    T_cam_bin = np.linalg.inv(T_WORLD_CAM) @ similarity(1.0, turn_about_z(YAW), np.zeros(3))
    x, y = LENGTH / 2, WIDTH / 2
    for shift, inside in ((-0.025, True), (0.012, False)):
        corners = [[s * (x + shift), t * (y + shift), 0.0] for s in (-1, 1) for t in (-1, 1)]
        plan = table.plan(transform_points(T_cam_bin, np.array(corners)))
        held = (plan @ one.inside[:, :2].T + one.inside[:, 2] <= 0).all(axis=1)
        assert held.all() if inside else not held.any()


def test_heights_in_a_bin_are_above_its_floor():
    frame = seen(standing((0.08, 0.06, 0.07), 0.05, 0.02))
    height = surfaces(frame).height
    top = np.nanpercentile(height[frame.segmap == 1], 90)
    assert top == pytest.approx(0.07, abs=0.002)


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_things_in_a_bin_have_masks_and_its_walls_have_none(noise):
    frame = seen(
        standing((0.08, 0.06, 0.07), -0.08, 0.03), standing((0.05, 0.09, 0.05), 0.09, -0.02),
        noise=noise,
    )  # fmt: skip
    found = segment(frame)
    assert found.max() == 2
    assert min(found_as(found, frame.segmap == i) for i in (1, 2)) > 0.7


def test_what_stands_against_a_wall_and_over_the_rim_is_whole():
    tall = standing((0.08, 0.06, 0.2), 0.0, WIDTH / 2 - 0.032)
    frame = seen(tall)
    found = segment(frame)
    assert found.max() == 1
    assert found_as(found, frame.segmap == 1) > 0.8


def test_what_stands_beside_a_bin_is_found_too():
    ball = solids.moved(solids.ball(0.04), x=0.26, y=0.0)
    inside = standing((0.08, 0.06, 0.07), -0.05, 0.0)
    frame = seen(ball, inside)
    found = segment(frame)
    assert found.max() == 2
    assert min(found_as(found, frame.segmap == i) for i in (1, 2)) > 0.7


def test_a_bin_of_which_a_wall_has_no_depth_is_one():
    whole = seen(standing((0.08, 0.06, 0.07), 0.0, 0.0))
    near = np.zeros(whole.shape, bool)
    near[165:] = True  # the lower part of the image: the nearest wall and its corners
    part = seen(standing((0.08, 0.06, 0.07), 0.0, 0.0), without_depth=near)
    assert [len(surfaces(frame).table.bins) for frame in (whole, part)] == [1, 1]


def test_a_bin_that_the_border_cuts_is_one():
    aside = camera_pose(np.array([0.14, 0.12, 0.03]), 0.6, np.deg2rad(60.0), 0.9)
    frame = seen(standing((0.08, 0.06, 0.07), 0.05, 0.02), T_world_cam=aside)
    assert len(surfaces(frame).table.bins) == 1
    found = segment(frame)
    assert found.max() == 1 and found_as(found, frame.segmap == 1) > 0.7


@pytest.mark.parametrize("stretched", [(1.0, 1.0), (1.3, 0.9)])
def test_a_round_basket_and_an_oval_one_are_bins(stretched):
    outer, hollow = (
        solids.moved(trimesh.creation.cylinder(radius, 0.12, sections=64), z=0.06 + up)
        for radius, up in ((0.184, 0.0), (0.18, FLOOR))
    )
    basket = solids.difference(outer, hollow).apply_transform(np.diag([*stretched, 1.0, 1.0]))
    frame = seen(standing((0.08, 0.06, 0.07), 0.05, 0.02), bin=basket)
    found = segment(frame)
    assert len(surfaces(frame).table.bins) == 1
    assert found.max() == 1 and found_as(found, frame.segmap == 1) > 0.9


def test_things_in_two_bins_side_by_side_have_masks():
    beside = WIDTH + 2 * WALL + 0.001
    both = trimesh.util.concatenate([bin_mesh(), solids.moved(bin_mesh(), y=beside)])
    things = [standing((0.08, 0.06, 0.07), x, y) for x, y in ((0.05, 0.02), (-0.05, beside))]
    wide = camera_pose(np.array([0.0, 0.2, 0.03]), 1.15, np.deg2rad(55.0), 0.9)
    frame = seen(*things, bin=both, T_world_cam=wide)
    found = segment(frame)
    # What parts them is a thing.
    assert found.max() <= 3
    assert min(found_as(found, frame.segmap == i) for i in (1, 2)) > 0.85


def test_bowls_and_heaps_of_boxes_are_no_bins():
    bowl = solids.spherical_bowl(0.06, 0.13, 0.08, 0.004)
    assert surfaces(seen(bin=bowl)).table.bins == ()
    heights = (0.06, 0.1, 0.16, 0.08, 0.13, 0.05)
    angles = np.linspace(0, 2 * np.pi, len(heights), endpoint=False)
    around = [
        solids.moved(solids.box(0.09, 0.07, high), x=0.17 * np.cos(a), y=0.17 * np.sin(a))
        for high, a in zip(heights, angles, strict=True)
    ]
    frame = seen(*around[1:], bin=around[0])
    assert surfaces(frame).table.bins == ()


def test_an_empty_bin_is_a_thing():
    frame = seen()
    assert surfaces(frame).table.bins == ()
    assert segment(frame).max() >= 1


def test_on_a_table_of_any_size_nothing_breaks():
    rng = np.random.default_rng(0)
    plan = rng.uniform(-1e6, 1e6, (1000, 2))
    height = rng.uniform(0, 0.4, 1000)
    assert plan_cells(plan, height, CONFIG.bins) is None
    assert plan_cells(plan[:0], height[:0], CONFIG.bins) is None
    cells = plan_cells(np.zeros((5, 2)), np.full(5, 0.1), CONFIG.bins)
    assert find_bins(cells, CONFIG.bins) == ()
    assert find_platforms(cells, CONFIG.platforms) == ()


@pytest.mark.parametrize("turn_by", [0.0, 0.4, 1.2])
def test_a_rectangle_is_found_among_other_points(turn_by):
    rng = np.random.default_rng(1)
    x, y = np.arange(-0.2, 0.2, 0.01), np.arange(-0.15, 0.15, 0.01)
    sides = [np.stack([x, np.full_like(x, s * 0.15)], 1) for s in (-1, 1)]
    sides += [np.stack([np.full_like(y, s * 0.2), y], 1) for s in (-1, 1)]
    others = rng.uniform(-0.3, 0.3, (40, 2))
    R = np.array([[np.cos(turn_by), -np.sin(turn_by)], [np.sin(turn_by), np.cos(turn_by)]])
    points = np.concatenate([*sides, others]) @ R.T + [0.5, -0.2]
    corners = np.array([[s * 0.2, t * 0.15] for s in (-1, 1) for t in (-1, 1)]) @ R.T + [0.5, -0.2]
    found = list(rectangles(points, CONFIG.bins))
    # Each corner of the true one lies on two of its sides.
    off = [np.sort(np.abs(corners @ h[:, :2].T + h[:, 2]), axis=1)[:, :2].max() for h in found]
    assert min(off) < 0.02
