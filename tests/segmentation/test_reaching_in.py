"""An arm that reaches in over the table is known, and what stands or lies there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import room_scene
import trimesh
from scipy.ndimage import binary_dilation

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.segmentation.reaching_in import reaching_in
from brrp_cli.segmentation.rising import rising
from brrp_cli.segmentation.seen_surfaces import see_surfaces
from brrp_cli.segmentation.segment import segment, segment_and_aside
from brrp_cli.shapes import solids

CONFIG = SegmentConfig()
ELEVATION, DISTANCE = 0.6, 0.7


def arm(tip=(0.0, 0.0, 0.2), end=(-0.5, 0.6, 0.4)) -> trimesh.Trimesh:
    """From above the things to beyond the image."""
    return trimesh.creation.cylinder(0.035, segment=[tip, end])


def photograph(things, elevation=ELEVATION, distance=DISTANCE) -> Frame:
    return room_scene.photograph(things, [room_scene.TABLE], elevation=elevation, distance=distance)


def found_in(frame: Frame) -> np.ndarray:
    seen = see_surfaces(frame, 0, CONFIG)
    return reaching_in(frame, seen, rising(seen, CONFIG).lift, CONFIG)


def overlaps(masks: np.ndarray, frame: Frame, ids) -> list[float]:
    """The best overlap of a mask with each true one."""
    best = []
    for true in (frame.segmap == i for i in ids):
        mine = (masks == i for i in np.unique(masks[masks > 0]))
        best.append(max(float((m & true).sum() / (m | true).sum()) for m in mine))
    return best


@pytest.mark.parametrize("end", [(-0.5, 0.6, 0.4), (-0.9, -0.2, 0.3), (-0.3, -0.9, 0.2)])
def test_an_arm_over_the_table_is_found_and_nothing_else(end):
    frame = photograph([*room_scene.THINGS, arm(end=end)])
    true = frame.segmap == 3
    found = found_in(frame)
    assert (found & true).sum() > 0.9 * true.sum()
    assert (found & ~true).sum() < 0.02 * true.sum()


def test_a_hand_that_is_seen_apart_from_its_arm_is_a_part_of_it_and_what_it_hangs_over_is_none():
    hand = solids.moved(solids.box(0.06, 0.06, 0.05), z=0.2)
    # A top that stands on a box is as high.
    box, top = solids.box(0.1, 0.1, 0.1), solids.moved(solids.box(0.04, 0.04, 0.05), z=0.1)
    frame = photograph([box, top, hand, arm(tip=(-0.05, 0.06, 0.26))])
    depth = frame.depth.copy()
    depth[binary_dilation(frame.segmap == 4, iterations=2) & (frame.segmap == 3)] = 0
    parted = make_frame(rgb=frame.rgb, depth=depth, K=frame.K, segmap=frame.segmap)
    found = found_in(parted)
    seen = parted.valid & (frame.segmap == 3)
    assert found[seen].mean() > 0.85 and found[frame.segmap == 4].mean() > 0.9
    assert found[(frame.segmap == 1) | (frame.segmap == 2)].mean() < 0.02


def test_what_stands_is_none_though_the_border_cuts_it():
    pillar = solids.moved(solids.box(0.06, 0.06, 0.6), x=-0.1, y=0.1)
    frame = photograph([*room_scene.THINGS, pillar])
    assert frame.segmap[0].any(), "the border cuts it"
    assert not found_in(frame).any()


def test_what_stands_is_none_though_its_foot_is_beyond_the_image_or_hidden():
    before = room_scene.turned(solids.moved(solids.box(0.1, 0.1, 0.2), x=0.18), room_scene.YAW)
    frame = photograph([*room_scene.THINGS, before], distance=0.5)
    assert frame.segmap[-1].any(), "the border cuts its foot off"
    assert not found_in(frame).any()
    beneath = solids.moved(solids.box(0.5, 0.12, 0.15), y=0.1)
    above = photograph([beneath], elevation=1.5, distance=0.5)
    assert (above.segmap[0] == 1).any() or (above.segmap[-1] == 1).any()
    assert not found_in(above).any(), "seen from above it shows no foot"


def test_what_hangs_within_the_image_is_none():
    hanging = solids.moved(solids.box(0.06, 0.06, 0.05), z=0.2)
    assert not found_in(photograph([*room_scene.THINGS, hanging])).any()


def test_what_is_behind_the_table_is_none():
    short = trimesh.creation.box((0.8, 0.8, 0.02)).apply_translation([0, 0, -0.01])
    behind = room_scene.turned(solids.moved(solids.box(0.1, 0.3, 0.6), x=-0.8, z=0.05))
    frame = room_scene.photograph(
        [*room_scene.THINGS, behind], [room_scene.turned(short)], elevation=0.35, distance=0.7
    )
    assert frame.segmap[0].any(), "the border cuts it"
    assert not found_in(frame).any()


def test_before_a_wall_nothing_is_taken_for_an_arm():
    things = [*room_scene.THINGS, arm()]
    background = [room_scene.TABLE, room_scene.wall()]
    frame = room_scene.photograph(things, background, elevation=0.25)
    assert see_surfaces(frame, 0, CONFIG).table.walled
    assert not found_in(frame).any()


def test_masks_beneath_an_arm_are_those_without_it_and_it_has_one_on_demand():
    bowl = solids.spherical_bowl(0.04, 0.09, 0.04, 0.004)
    things = [bowl, solids.moved(solids.box(0.05, 0.05, 0.08), x=0.02, y=-0.14)]
    # As of a bowl's inside, what is seen of the arm faces the middle of both.
    frame = photograph([*things, arm(tip=(0.0, 0.06, 0.2), end=(0.61, -0.67, 0.36))])
    masks, aside = segment_and_aside(frame)
    assert masks.max() == 2
    assert min(overlaps(masks, frame, (1, 2))) > 0.95
    assert not aside[frame.segmap == 3].any(), "nor is it tried against stored objects"
    assert overlaps(segment(frame, keep_all=True), frame, (3,))[0] > 0.85


def test_where_an_arm_is_all_that_is_told_and_all_keeps_it():
    frame = photograph([arm()])
    with pytest.raises(FrameError, match="only what reaches in over the table"):
        segment_and_aside(frame)
    assert overlaps(segment(frame, keep_all=True), frame, (1,))[0] > 0.85


def test_a_thing_in_a_hand_has_a_mask_of_its_own_on_demand():
    held = solids.moved(solids.box(0.05, 0.05, 0.1), z=0.12)
    frame = photograph([*room_scene.THINGS, held, arm(tip=(-0.03, 0.0, 0.25))])
    frame = replace(frame, rgb=np.where(frame.segmap[..., None] == 4, np.uint8(230), frame.rgb))
    assert segment(frame).max() == 2
    assert overlaps(segment(frame, keep_all=True), frame, (3,))[0] > 0.6
