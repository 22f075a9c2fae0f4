"""Masks that may be of one object, or of two, on images whose parts are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import K, in_camera, photograph, placed

from brrp_cli.config.mending import RegroupConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.segmentation.other_masks import OtherMask, other_masks, painted, unions
from brrp_cli.shapes import solids

CONFIG = RegroupConfig()


def row_of_masks(gaps=(0, 0), depths=(0.8, 0.8, 0.8)):
    """Masks 1, 2, 3 of 40 x 20 pixels in a row, so many pixels and so far apart."""
    segmap, depth = np.zeros((80, 120), np.int64), np.full((80, 120), 1.0)
    left = 20
    for i, (gap, far) in enumerate(zip((*gaps, 0), depths, strict=True), start=1):
        part = np.s_[20:60, left : left + 20]
        segmap[part], depth[part] = i, far
        left += 20 + gap
    return Frame(np.zeros((80, 120, 3), np.uint8), backproject(depth, K), segmap, K)


def test_of_a_chain_all_are_one_try_and_each_two_neighbours_another():
    found = unions(row_of_masks(), [1, 2, 3], CONFIG)
    assert found == [{1, 2, 3}, {1, 2}, {2, 3}]
    assert unions(row_of_masks(), [1, 2], CONFIG) == [{1, 2}]
    assert unions(row_of_masks(), [1, 3], CONFIG) == []


@pytest.mark.parametrize(("gap", "near"), [(CONFIG.reach - 1, True), (CONFIG.reach, False)])
def test_neighbours_are_near_in_the_image(gap, near):
    assert bool(unions(row_of_masks((gap, 40)), [1, 2], CONFIG)) == near


@pytest.mark.parametrize(("apart", "near"), [(0.9, True), (1.1, False)])
def test_neighbours_are_near_in_depth(apart, near):
    frame = row_of_masks(depths=(0.8, 0.8 + apart * CONFIG.gap, 2.0))
    assert bool(unions(frame, [1, 2], CONFIG)) == near


def test_what_is_in_doubt_is_tried_with_each_neighbour_that_is_recognised():
    found = other_masks(row_of_masks(), [2], None, SegmentConfig(), whole=[2], known=[1, 3])
    assert [(each.of, each.known) for each in found] == [({1, 2}, {1}), ({2, 3}, {3})]
    assert not other_masks(row_of_masks(), [], None, SegmentConfig(), known=[1, 2, 3])


def test_pieces_of_one_colour_hang_together_over_wider_gaps():
    frame = row_of_masks((20, 20))
    rgb = np.full((*frame.shape, 3), 128, np.uint8)
    rgb[frame.segmap > 0] = (40, 40, 160)
    rgb[frame.segmap == 3] = (160, 40, 40)
    assert unions(replace(frame, rgb=rgb), [1, 2, 3], CONFIG) == [{1, 2}]
    assert unions(frame, [1, 2, 3], CONFIG) == []  # no colours
    gone = 9  # an object whose mask was taken over
    assert unions(replace(frame, rgb=rgb), [1, 2, 3, gone], CONFIG) == [{1, 2}]
    near = replace(CONFIG, apart=19)
    assert unions(replace(frame, rgb=rgb), [1, 2, 3], near) == []


def test_two_things_in_one_mask_are_its_halves():
    first, second = (
        in_camera(solids.box(0.08, 0.08, high), placed(x, 0.0, 0.3))
        for x, high in ((-0.1, 0.1), (0.06, 0.05))
    )
    truth = photograph({1: first, 2: second})
    frame = replace(truth, segmap=np.where(truth.segmap > 0, 7, 0))
    depth_alone = SegmentConfig(regroup=replace(CONFIG, colours=()))
    halves = other_masks(frame, [7], None, depth_alone)
    assert len(halves) == 2
    assert {each.of for each in halves} == {frozenset([7])}
    for object_id in (1, 2):
        mask = truth.segmap == object_id
        assert max((each.mask & mask).sum() / (each.mask | mask).sum() for each in halves) > 0.95
    # Also of a mask that was left out, as where the image's border cuts one of the two.
    bare = replace(truth, segmap=np.zeros_like(truth.segmap))
    whole, *parts = other_masks(bare, [], frame.segmap, depth_alone)
    assert (whole.mask == (truth.segmap > 0)).all() and not whole.of and not whole.cut
    assert [(each.of, each.cut) for each in parts] == [(frozenset(), True)] * 2
    assert all((a.mask == b.mask).all() for a, b in zip(parts, halves, strict=True))


def test_what_was_left_out_is_tried_where_nothing_else_is():
    frame = row_of_masks()
    aside = np.roll(np.where(frame.segmap == 3, 5, 0), 10, axis=1)
    (found,) = other_masks(frame, [], aside, SegmentConfig())
    assert not found.of and (found.mask == ((aside == 5) & (frame.segmap == 0))).all()
    few = SegmentConfig(regroup=replace(CONFIG, least_pixels=int(found.mask.sum()) + 1))
    assert other_masks(frame, [], aside, few) == []


def test_what_was_left_out_is_tried_with_its_neighbours():
    whole = row_of_masks()
    frame, aside = replace(whole, segmap=whole.segmap % 3), np.where(whole.segmap == 3, 1, 0)
    found = other_masks(frame, [2], aside, SegmentConfig())
    assert [each.of for each in found] == [frozenset(), {2}]
    assert (found[1].mask == (whole.segmap >= 2)).all()


def test_there_are_no_more_tries_than_allowed():
    frame, config = row_of_masks(), SegmentConfig(regroup=replace(CONFIG, most=2))
    assert len(other_masks(frame, [1, 2, 3], None, config)) == 2


def test_parts_of_two_colours_are_found_where_depth_is_flat():
    frame = row_of_masks()
    rgb = np.where((np.arange(120) < 40)[None, :, None], [200, 40, 40], [40, 60, 180])
    noise = np.random.default_rng(0).normal(0, 12, (80, 120, 3))
    segmap = np.where(np.isin(frame.segmap, [1, 2]), 1, 0)
    rgb = np.clip(rgb + noise, 0, 255).astype(np.uint8)
    two = replace(frame, rgb=rgb, segmap=segmap)
    found = other_masks(two, [1], None, SegmentConfig())
    for true_id in (1, 2):
        mask = frame.segmap == true_id
        assert max((each.mask & mask).sum() / (each.mask | mask).sum() for each in found) > 0.95
    assert other_masks(two, [1], None, SegmentConfig(), whole=[1]) == []
    again = other_masks(two, [1], None, SegmentConfig())
    assert all((a.mask == b.mask).all() for a, b in zip(found, again, strict=True))


def test_what_is_of_one_colour_is_not_cut_by_colour():
    frame = row_of_masks()
    noise = np.random.default_rng(0).normal(0, 12, (80, 120, 3))
    rgb = np.clip(noise + [180, 140, 90], 0, 255).astype(np.uint8)
    plain = replace(frame, rgb=rgb, segmap=np.minimum(frame.segmap, 1))
    assert other_masks(plain, [1], None, SegmentConfig()) == []


def test_parts_lie_in_their_mask_are_large_enough_and_come_once():
    frame = row_of_masks()
    rng = np.random.default_rng(1)
    rgb = rng.integers(0, 255, (8, 12, 3)).repeat(10, axis=0).repeat(10, axis=1).astype(np.uint8)
    whole = replace(frame, rgb=rgb, segmap=np.minimum(frame.segmap, 1))
    found = other_masks(whole, [1], None, SegmentConfig())
    assert len(found) > 2
    for i, each in enumerate(found):
        assert not (each.mask & (whole.segmap != 1)).any()
        assert each.mask.sum() >= CONFIG.least_pixels
        for other in [*found[:i], OtherMask(whole.segmap == 1, frozenset())]:
            assert (each.mask ^ other.mask).sum() >= CONFIG.same * each.mask.sum()


def test_a_union_has_its_lowest_id_and_a_part_a_new_one():
    frame = row_of_masks()
    union = OtherMask(frame.segmap >= 2, frozenset([2, 3]))
    part = OtherMask((frame.segmap == 1) & (np.arange(120) < 30), frozenset([1]), cut=True)
    segmap, named = painted(frame.segmap, [union, part], 1)
    assert named == {2: union, 4: part}
    assert set(np.unique(segmap)) == {0, 1, 2, 4}
    assert (painted(frame.segmap, [part], 9)[0] == 9).sum() == part.mask.sum()
    parts = OtherMask((frame.segmap > 1) & (np.arange(120) > 50), frozenset([2, 3]), cut=True)
    assert painted(frame.segmap, [parts], 1)[1] == {4: parts}
