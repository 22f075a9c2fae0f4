"""Segmentation of a scene whose masks are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import room_scene
import trimesh
from scipy.ndimage import binary_dilation
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.config.segmentation import (
    BordersConfig,
    ConcavitiesConfig,
    LeftOutConfig,
    SegmentConfig,
)
from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.segmentation.fill_concavities import fill_inside
from brrp_cli.segmentation.left_out import EDGE, IN_THE_AIR, left_out
from brrp_cli.segmentation.refine_borders import refine_borders
from brrp_cli.segmentation.segment import segment, segment_and_aside
from brrp_cli.shapes import solids

NOWHERE = np.zeros((60, 80), bool)  # over the table


def noisy(depth, seed=0):
    """Depth as a sensor gives it: noise, millimetres, and smeared edges."""
    rng = np.random.default_rng(seed)
    depth = depth + rng.normal(0, 0.0015, depth.shape) * depth**2
    smeared = depth.copy()
    smeared[:, 1:-1] = (depth[:, :-2] + 2 * depth[:, 1:-1] + depth[:, 2:]) / 4
    return (smeared * 1000).round() / 1000


def overlap(first, second):
    """Intersection over union of two masks."""
    return (first & second).sum() / (first | second).sum()


@pytest.mark.parametrize("degrade", [lambda depth: depth, noisy], ids=["clean", "noisy"])
def test_objects_on_the_table_are_found_from_left_to_right(scene, degrade):
    depth = degrade(np.where(np.isfinite(scene.depth), scene.depth, 0))
    found = segment(make_frame(rgb=scene.rgb, depth=depth, K=scene.K))
    assert np.unique(found).tolist() == [0, 1, 2, 3]
    for number, object_id in [(1, 7), (2, 250), (3, -3)]:
        assert overlap(found == number, scene.segmap == object_id) > 0.7, object_id


def test_the_same_seed_gives_the_same_masks(scene):
    frame = make_frame(rgb=scene.rgb, depth=scene.depth, K=scene.K)
    assert np.array_equal(segment(frame, 3), segment(frame, 3))


def test_the_frames_own_masks_are_not_looked_at(scene):
    frames = [
        make_frame(segmap=mask, depth=scene.depth, K=scene.K) for mask in (None, scene.segmap)
    ]
    assert np.array_equal(segment(frames[0]), segment(frames[1]))


def test_what_stands_beside_the_table_is_background(scene):
    found = segment(make_frame(depth=scene.depth, K=scene.K))
    wall = scene.depth > 1.3
    assert wall.sum() > 100
    assert not found[wall & (scene.segmap == 0)].any()


def test_the_table_on_both_sides_of_a_thing_that_goes_across_the_image_is_one():
    across = solids.box(0.12, 0.9, 0.12)
    before = solids.moved(solids.box(0.05, 0.05, 0.06), x=0.2, y=0.03)
    frame = room_scene.photograph(
        [room_scene.turned(across), room_scene.turned(before)],
        [room_scene.TABLE],
        elevation=0.6,
        distance=0.7,
    )
    masks = segment(frame, keep_all=True)
    assert masks.max() == 2
    for object_id in frame.object_ids:
        mine = masks == np.bincount(masks[frame.segmap == object_id]).argmax()
        assert overlap(mine, frame.segmap == object_id) > 0.9


def test_an_empty_table_and_no_table_are_told(scene):
    v, _ = np.mgrid[:120, :160]
    slope = (v - scene.K[1, 2]) / scene.K[1, 1]
    table = 0.5 / (0.7 * slope + 0.7)  # a plane that is tilted by 45 degrees
    with pytest.raises(FrameError, match="Nothing stands on the table"):
        segment(make_frame(depth=table, K=scene.K))
    clutter = np.random.default_rng(0).uniform(0.5, 5, scene.depth.shape)
    with pytest.raises(FrameError, match="Too little depth"):
        segment(make_frame(depth=clutter, K=scene.K))


def test_a_bowls_floor_is_filled_and_the_crook_of_a_bend_is_not():
    plan = np.stack(np.meshgrid(np.arange(100) / 500, np.arange(100) / 500), axis=-1)
    radius = np.linalg.norm(plan - 0.1, axis=-1)
    everywhere = np.ones((100, 100), bool)
    ring = ((radius > 0.06) & (radius < 0.08)).astype(np.int64) * 5
    assert fill_inside(ring, plan, everywhere, ConcavitiesConfig())[50, 50] == 5
    assert (fill_inside(ring, plan, everywhere, ConcavitiesConfig())[radius > 0.085] == 0).all()
    assert np.array_equal(fill_inside(ring, plan, ~everywhere, ConcavitiesConfig()), ring)
    half = np.where(plan[..., 0] < 0.1, ring, 0)
    assert fill_inside(half, plan, everywhere, ConcavitiesConfig())[50, 49] == 0


def boxes(*placed):
    """A frame of boxes (size, x, y, z) on a table, noisy; the true masks are its own, 1, 2, ..."""
    things = {
        number: in_camera(solids.moved(solids.box(*size), x=x, y=y, z=z), T_CAM_WORLD)
        for number, (size, x, y, z) in enumerate(placed, start=1)
    }
    clean = photograph(things)
    depth = noisy(np.nan_to_num(clean.points[..., 2]))
    return make_frame(rgb=clean.rgb, segmap=clean.segmap, depth=depth, K=clean.K)


@pytest.mark.parametrize(
    "placed",
    [
        [((0.08, 0.08, 0.06), 0, -0.041, 0), ((0.08, 0.08, 0.16), -0.03, 0.041, 0)],
        [((0.16, 0.14, 0.06), 0, 0, 0), ((0.07, 0.06, 0.07), 0, 0, 0.06)],
    ],
    ids=["side by side", "on top"],
)
def test_things_that_touch_are_two(placed):
    frame = boxes(*placed)
    found = segment(frame)
    for truth in (1, 2):
        best = max(overlap(found == i, frame.segmap == truth) for i in np.unique(found[found > 0]))
        assert best > 0.7, truth


@pytest.mark.parametrize(("top", "count"), [((210, 170, 20), 1), ((150, 40, 160), 2)])
def test_a_stud_of_its_bricks_colour_is_no_thing_of_its_own(top, count):
    frame = boxes(((0.16, 0.14, 0.06), 0, 0, 0), ((0.07, 0.06, 0.07), 0, 0, 0.06))
    rgb = np.full((*frame.shape, 3), 120, np.uint8)
    rgb[frame.segmap == 1] = (220, 180, 30)
    rgb[frame.segmap == 2] = top
    assert segment(replace(frame, rgb=rgb)).max() == count


def test_a_thin_thing_is_found():
    frame = boxes(((0.16, 0.04, 0.01), 0, 0, 0))
    assert overlap(segment(frame) == 1, frame.segmap == 1) > 0.6


def test_a_small_thing_is_found_where_the_network_is_sure_of_it():
    frame = boxes(((0.019, 0.019, 0.019), 0, 0, 0), ((0.06, 0.06, 0.06), -0.2, 0, 0))
    found = segment(frame)
    assert found.max() == 2
    assert overlap(found[frame.segmap != 2] > 0, frame.segmap[frame.segmap != 2] == 1) > 0.5
    doubted = segment(frame, config=replace(SegmentConfig(), sure=1.0))
    assert doubted.max() == 1
    assert not (doubted[frame.segmap == 1] > 0).any()


def test_a_mug_is_one_thing():
    outside = trimesh.creation.cylinder(0.05, 0.1, sections=48)
    inside = trimesh.creation.cylinder(0.044, 0.1, sections=48).apply_translation([0, 0, 0.008])
    mug = in_camera(outside.difference(inside).apply_translation([0, 0, 0.05]), T_CAM_WORLD)
    clean = photograph({1: mug})
    depth = noisy(np.nan_to_num(clean.points[..., 2]))
    found = segment(make_frame(depth=depth, K=clean.K))
    assert overlap(found == 1, clean.segmap == 1) > 0.75


@pytest.mark.parametrize("floor", [0.002, None])
def test_the_table_within_a_ring_is_no_part_of_it_and_the_floor_of_a_dish_is(floor):
    outside = trimesh.creation.cylinder(0.09, 0.03, sections=48)
    inside = trimesh.creation.cylinder(0.075, 0.04, sections=48)
    if floor is not None:
        inside.apply_translation([0, 0, 0.005 + floor])
    thing = in_camera(outside.difference(inside).apply_translation([0, 0, 0.015]), T_CAM_WORLD)
    clean = photograph({1: thing})
    depth = noisy(np.nan_to_num(clean.points[..., 2]))
    frame = make_frame(segmap=clean.segmap, depth=depth, K=clean.K)
    found = segment(painted(frame, (200, 60, 40)))
    assert overlap(found == 1, frame.segmap == 1) > 0.75


def painted(frame, *colours):
    rgb = np.full((*frame.shape, 3), 120, np.uint8)
    for object_id, colour in enumerate(colours, start=1):
        rgb[frame.segmap == object_id] = colour
    return replace(frame, rgb=rgb)


@pytest.mark.parametrize(
    ("lower", "upper", "count"), [((40, 60, 160), (200, 180, 60), 2), ((40, 60, 160),) * 2 + (1,)]
)
def test_boxes_of_two_colours_stacked_flush_are_two(lower, upper, count):
    frame = boxes(((0.1, 0.1, 0.07), 0, 0, 0), ((0.1, 0.1, 0.06), 0, 0, 0.07))
    found = segment(painted(frame, lower, upper))
    assert found.max() == count
    if count == 2:
        for truth in (1, 2):
            assert max(overlap(found == i, frame.segmap == truth) for i in (1, 2)) > 0.7, truth


def test_a_print_of_many_colours_is_no_seam():
    rng = np.random.default_rng(0)
    frame = boxes(((0.1, 0.1, 0.14), 0, 0, 0))
    ink = np.array([(40, 60, 160), (200, 180, 60), (220, 220, 220)], np.uint8)
    printed = ink[rng.integers(0, 3, (30, 40))].repeat(8, axis=0).repeat(8, axis=1)
    rgb = np.where((frame.segmap == 1)[..., None], printed, np.uint8(120))
    assert segment(replace(frame, rgb=rgb)).max() == 1


def test_what_the_border_cuts_is_kept_on_demand_alone():
    frame = boxes(((0.1, 0.1, 0.06), 0, 0, 0), ((0.1, 0.3, 0.08), 0.0, 0.33, 0))
    cut = frame.segmap == 2
    assert cut[:, [0, -1]].any() and cut.sum() > 300
    found = segment(frame)
    assert found.max() == 1
    assert overlap(found == 1, frame.segmap == 1) > 0.7
    everything = segment(frame, keep_all=True)
    assert everything.max() == 2
    assert max(overlap(everything == i, cut) for i in (1, 2)) > 0.7


def test_what_the_border_cuts_is_not_forgotten_unless_it_is_a_corner_of_something():
    frame = boxes(((0.1, 0.1, 0.06), 0, 0, 0), ((0.1, 0.3, 0.08), 0.0, 0.33, 0))
    found, aside = segment_and_aside(frame)
    assert overlap(found > 0, frame.segmap == 1) > 0.7
    assert overlap(aside > 0, frame.segmap == 2) > 0.7
    shown = int((aside > 0).sum())
    asked = SegmentConfig(left_out=replace(LeftOutConfig(), tell=shown + 1))
    again, corners = segment_and_aside(frame, config=asked)
    assert (again == found).all() and not corners.any()


def test_where_the_border_cuts_all_there_are_masks_for_a_prior_alone():
    """What is recognised in them is an object; without a prior nothing is."""
    frame = boxes(((0.1, 0.3, 0.08), 0.0, 0.33, 0))
    with pytest.raises(FrameError, match="Nothing stands on the table"):
        segment(frame)
    masks, aside = segment_and_aside(frame)
    assert masks.max() == 1 and ((masks > 0) == (aside > 0)).all()
    assert overlap(masks > 0, frame.segmap == 1) > 0.7


def test_what_hangs_in_the_air_is_left_out_and_what_stands_on_a_thing_is_not():
    things = [((0.1, 0.1, 0.06), 0, 0, 0), ((0.06, 0.06, 0.06), 0, 0, 0.06)]
    assert segment(boxes(*things)).max() == 2
    hanging = boxes(things[0], ((0.06, 0.06, 0.06), -0.1, -0.15, 0.12))
    found, aside = segment_and_aside(hanging)
    assert found.max() == 1 and (found == segment(hanging)).all()
    assert overlap(aside > 0, hanging.segmap == 2) > 0.7
    assert segment(hanging, keep_all=True).max() == 2


def test_a_flat_thing_without_depth_around_it_is_left_out_but_not_forgotten():
    flat = boxes(((0.12, 0.08, 0.022), 0, 0, 0), ((0.06, 0.06, 0.06), -0.2, 0, 0))
    around = binary_dilation(flat.segmap == 1, iterations=10) & (flat.segmap != 1)
    lonely = make_frame(rgb=flat.rgb, depth=np.where(around, 0.0, flat.depth), K=flat.K)
    found, aside = segment_and_aside(lonely)
    assert overlap(found > 0, flat.segmap == 2) > 0.7
    assert overlap(aside > 0, flat.segmap == 1) > 0.7


def test_a_ball_whose_lower_half_is_hidden_stands_and_a_flat_thing_in_the_air_does_not():
    segmap = np.zeros((60, 80), np.int64)
    segmap[20:40, 10:30] = 1
    segmap[20:40, 50:70] = 2
    depth = np.ones((60, 80))
    # From above: the upper half of a ball of 9 cm, and a lid at the same height.
    ball = np.linspace(0.09, 0.048, 20)[:, None]
    height = np.where(segmap == 1, np.pad(ball, ((20, 20), (0, 0))), 0.0)
    height = np.where(segmap == 2, 0.062, height)
    assert left_out(segmap, depth, height, NOWHERE, NOWHERE, LeftOutConfig()) == {2: IN_THE_AIR}


def test_what_lies_on_a_thing_without_depth_at_its_edge_stands():
    segmap = np.zeros((60, 80), np.int64)
    segmap[20:30, 20:40] = 1
    segmap[30:50, 20:40] = 2
    depth = np.ones((60, 80))
    height = np.where(segmap == 1, 0.1, np.where(segmap == 2, 0.03, 0.0))
    depth[30:50, 20:40] = np.nan
    height[30:50, 20:40] = np.nan
    assert left_out(segmap, depth, height, NOWHERE, NOWHERE, LeftOutConfig()) == {}
    assert left_out(segmap % 2, depth, height, NOWHERE, NOWHERE, LeftOutConfig()) == {1: IN_THE_AIR}


def test_a_large_ball_over_the_table_stands_and_what_is_beside_the_table_does_not():
    segmap = np.zeros((60, 80), np.int64)
    segmap[20:40, 10:30] = 1
    depth = np.ones((60, 80))
    # The upper half of a ball of 14 cm.
    ball = np.linspace(0.14, 0.075, 20)[:, None]
    height = np.where(segmap > 0, np.pad(ball, ((20, 20), (0, 0))), 0.0)
    assert left_out(segmap, depth, height, ~NOWHERE, NOWHERE, LeftOutConfig()) == {}
    assert left_out(segmap, depth, height, NOWHERE, NOWHERE, LeftOutConfig()) == {1: IN_THE_AIR}


def test_a_mask_that_bled_over_the_table_ends_where_colour_does():
    segmap = np.zeros((80, 100), np.int64)
    segmap[20:60, 30:70] = 1
    rgb = np.full((80, 100, 3), (180, 160, 140), np.uint8)
    rgb[segmap == 1] = (40, 90, 160)
    rgb = (rgb + np.random.default_rng(0).normal(0, 5, rgb.shape)).clip(0, 255).astype(np.uint8)
    bled = np.zeros_like(segmap)
    bled[23:60, 24:70] = 1
    nowhere = np.zeros(segmap.shape, bool)
    refined = refine_borders(bled, rgb, nowhere, BordersConfig())
    assert overlap(refined == 1, segmap == 1) > 0.95 > overlap(bled == 1, segmap == 1)
    grey = np.full_like(rgb, 128)
    assert overlap(refine_borders(bled, grey, nowhere, BordersConfig()) == 1, bled == 1) > 0.95


def test_a_smear_at_the_tables_edge_is_told_from_a_flat_thing_on_it():
    v, u = np.mgrid[:60, :80]
    depth = np.where(v < 20, 2.0, 1.2 - 0.004 * v)
    segmap = np.zeros((60, 80), np.int64)
    segmap[20:24, 10:50] = 1
    segmap[40:44, 10:50] = 2
    height = np.where(segmap > 0, 0.012, 0.0)
    assert left_out(segmap, depth, height, NOWHERE, NOWHERE, LeftOutConfig()) == {1: EDGE}
    taller = np.where(segmap > 0, (u - 10) / 40 * 0.08, 0.0)
    assert left_out(segmap, depth, taller, NOWHERE, NOWHERE, LeftOutConfig()) == {}
