"""Masks of the last frame hold in the next one where objects rest."""

from __future__ import annotations

import numpy as np
import pytest
from test_tracking import BLUE, GREEN, RED, START, A, B, colour_of, scene

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.tracking.carried import with_carried
from brrp_cli.tracking.followed import Followed

TRACK = TrackConfig()
NEXT = 20


def joined(frame: Frame) -> Frame:
    """The frame as masks may come: all things in one."""
    return frame.with_masks((frame.segmap > 0).astype(np.int64))


def iou(one, other) -> float:
    return float((one & other).sum() / (one | other).sum())


def held(last: Frame, frame: Frame, mended=frozenset({1, 2, 3}), fixed=()):
    return with_carried(Followed(last, NEXT, mended), frame, TRACK, fixed)


@pytest.mark.parametrize("yaw", [0.4, 0.5], ids=["the camera stands", "the camera goes round"])
def test_what_was_mended_and_rests_stays_mended(yaw):
    last, now = scene(START, known=True), scene(START, yaw=yaw, known=True)
    found, carried = held(last, joined(now))
    colours = {colour_of(found, i) for i in found.object_ids}
    assert colours == set(START) and len(found.object_ids) == 3
    assert iou(carried, now.segmap > 0) > 0.95
    for i in found.object_ids:
        there = now.rgb == colour_of(found, i)
        assert iou(found.segmap == i, there.all(axis=-1)) > 0.95


def test_of_what_was_not_mended_masks_hold_before_a_camera_that_stands_only():
    last = scene(START, known=True)
    found, carried = held(last, joined(scene(START, known=True)), frozenset())
    assert len(found.object_ids) == 3 and not carried.any()
    going = joined(scene(START, yaw=0.5, known=True))
    assert held(last, going, frozenset())[0].object_ids == [1]


def test_where_the_frame_has_no_mask_only_what_was_mended_holds():
    last, now = scene(START), scene(START)
    bare = now.with_masks(np.where(now.segmap == 2, 0, now.segmap))
    assert len(held(last, bare, frozenset())[0].object_ids) == 2
    assert len(held(last, bare, frozenset({2}))[0].object_ids) == 3


def test_what_was_moved_has_the_mask_of_its_own_frame():
    last, now = scene(START), scene(START | {GREEN: (0.12, 0.13)})
    mask = {colour: (now.rgb == colour).all(axis=-1) for colour in START}
    found, carried = held(last, now)
    for colour in START:
        here = np.unique(found.segmap[mask[colour]])
        assert len(here) == 1 and iou(found.segmap == here[0], mask[colour]) > 0.98
    assert not (carried & mask[GREEN]).any()


def test_what_has_come_is_an_object_of_its_own():
    last = scene({RED: A, GREEN: B})
    now = scene(START)
    found, _ = held(last, joined(now), frozenset({1, 2}))
    assert {colour_of(found, i) for i in found.object_ids} == {RED, GREEN, BLUE}
    came = (now.rgb == BLUE).all(axis=-1)
    here = np.unique(found.segmap[came])
    assert len(here) == 1 and iou(found.segmap == here[0], came) > 0.9


def test_what_a_hand_hides_in_part_keeps_its_mask_where_it_is_seen():
    last, now = scene(START), scene(START)
    hand = now.segmap == 2
    hand[:, : int(np.median(np.nonzero(hand)[1]))] = False
    points = np.where(hand[..., None], now.points * 0.5, now.points)
    seen = Frame(now.rgb, points, np.where(hand, 7, (now.segmap > 0)), now.K)
    found, carried = held(last, seen)
    assert carried[(now.segmap == 2) & ~hand].all() and not carried[hand].any()
    assert len(np.unique(found.segmap[hand])) == 1


def test_masks_that_were_corrected_stay():
    last, now = scene(START), joined(scene(START))
    found, carried = held(last, now, fixed={1})
    assert np.array_equal(found.segmap, now.segmap) and not carried.any()


def test_a_camera_that_nobody_knows_carries_nothing():
    last, now = scene(START), joined(scene(START, yaw=1.2))
    found, carried = held(last, now)
    assert found is now and not carried.any()
