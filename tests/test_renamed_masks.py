"""Masks that were mended get the ids of the tracks that they show."""

from __future__ import annotations

import numpy as np
import pytest
from test_tracking import BLUE, GREEN, RED, START, colour_of, scene

from brrp_cli.config.tracking import TrackConfig
from brrp_cli.tracking.followed import Followed
from brrp_cli.tracking.lost import Lost
from brrp_cli.tracking.match import seen_again, thickness
from brrp_cli.tracking.renamed import new_names, with_names

TRACK = TrackConfig()


def ids_of(frame):
    return {colour_of(frame, i): i for i in frame.object_ids}


def test_what_was_cut_out_of_a_mask_has_the_id_that_it_had():
    """All three came in one mask, which kept one id; two were cut out and got the next ones."""
    last, now = scene(START, known=True), scene(START, yaw=0.5, known=True)
    before, cut = ids_of(last), ids_of(now)
    other = {cut[RED]: 20, cut[GREEN]: before[RED], cut[BLUE]: 21}
    mixed = with_names(now, other)
    names = new_names(Followed(last, 20), mixed, mixed.object_ids, 20, TRACK)
    assert ids_of(with_names(mixed, names)) == before


def test_masks_that_were_not_mended_keep_their_ids():
    last = scene(START, known=True)
    ids = ids_of(last)
    names = {ids[RED]: 30, ids[GREEN]: 31}
    mixed = with_names(last, names)
    assert new_names(Followed(last, 40), mixed, [30], 40, TRACK) == {30: ids[RED]}
    assert new_names(Followed(last, 40), mixed, [], 40, TRACK) == {}


def test_an_id_that_another_track_takes_is_left_to_it():
    """The rest of a mask kept the id of what was cut out of it, and is a thing that is new."""
    last = scene({RED: START[RED], GREEN: START[GREEN]}, known=True)
    now = scene(START, known=True)
    before, here = ids_of(last), ids_of(now)
    mixed = with_names(now, {here[BLUE]: before[RED], here[RED]: 8, here[GREEN]: before[GREEN]})
    names = new_names(Followed(last, 9), mixed, [before[RED], 8], 9, TRACK)
    assert ids_of(with_names(mixed, names)) == before | {BLUE: 9}


def test_what_was_out_of_sight_is_known_again():
    then = scene(START, known=True)
    last = then.with_masks(np.where(then.segmap == ids_of(then)[RED], 0, then.segmap))
    lost = (Lost(then, ids_of(then)[RED]),)
    mixed = with_names(then, {ids_of(then)[RED]: 12})
    names = new_names(Followed(last, 9, lost=lost), mixed, [12], 9, TRACK)
    assert names == {12: ids_of(then)[RED]}


def test_what_stands_before_an_object_is_not_that_object():
    """The old points fall on the mask of what hides them, but far behind its surface."""
    last, now = scene(START), scene(START)
    near = now.with_points(np.where((now.segmap == 2)[..., None], now.points * 0.5, now.points))
    assert seen_again(last, now, np.eye(4), 2, 2, TRACK.carry.gap) == 1
    assert seen_again(last, near, np.eye(4), 2, 2, TRACK.carry.gap) == 0


def test_the_thickness_of_a_rod_is_not_its_length():
    rng = np.random.default_rng(0)
    rod = rng.uniform(-0.5, 0.5, (5000, 3)) * [0.3, 0.04, 0.02]
    turned = rod @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert thickness(turned) == pytest.approx(0.04, rel=0.1)
