"""Objects that are out of sight for a while come back under their ids."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sphere_method import METHOD
from test_tracking import BLUE, GREEN, RED, START, A, B, colour_of, scene

from brrp_cli import Reconstructor
from brrp_cli.config.tracking import TrackConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.methods.registry import METHODS
from brrp_cli.tracking.lost import Lost, found_again, lost_tracks

TRACK = TrackConfig()


@pytest.fixture
def session(monkeypatch):
    monkeypatch.setitem(METHODS, METHOD.name, METHOD)
    return Reconstructor(method="sphere", track=True)


def by_colour(result) -> dict[tuple[int, ...], int]:
    return {colour_of(result.frame, i): i for i in result.frame.object_ids}


def hidden(frame: Frame, colour: tuple[int, ...]) -> Frame:
    """The frame with a hand before one of the objects, which has no mask."""
    mask = (frame.rgb == colour).all(axis=-1)
    points = np.where(mask[..., None], frame.points * np.float32(0.6), frame.points)
    rgb = np.where(mask[..., None], np.uint8(180), frame.rgb)
    return Frame(rgb, points, np.where(mask, 0, frame.segmap), frame.K, frame.T_world_cam)


@pytest.mark.parametrize("known", [True, False], ids=["pose known", "pose unknown"])
def test_what_a_hand_hides_has_its_id_when_it_is_seen_again(session, known):
    ids = by_colour(session(scene(START, known=known)))
    for _ in range(3):
        gone = session(hidden(scene(START, known=known), GREEN))
        assert by_colour(gone).keys() == {RED, BLUE}
    assert by_colour(session(scene(START, known=known))) == ids


def test_what_was_taken_away_has_left_its_id_behind(session):
    ids = by_colour(session(scene(START, known=True)))
    session(scene({RED: A, BLUE: START[BLUE]}, known=True))
    again = by_colour(session(scene(START, known=True)))
    assert again[RED] == ids[RED] and again[BLUE] == ids[BLUE]
    assert again[GREEN] not in ids.values()


def test_another_thing_in_the_place_of_a_hidden_one_is_another(session):
    ids = by_colour(session(scene(START, known=True)))
    session(hidden(scene(START, known=True), GREEN))
    other = (220, 210, 60)
    places = {RED: A, other: B, BLUE: START[BLUE]}
    assert by_colour(session(scene(places, known=True)))[other] not in ids.values()


def test_a_new_thing_is_none_that_is_hidden(session):
    """It has the colour and size of the hidden one and stands near by, but who can tell?"""
    ids = by_colour(session(scene(START, known=True)))
    near = scene({RED: A, BLUE: START[BLUE], GREEN: (0.16, 0.02)}, known=True)
    ahead = hidden(scene(START, known=True), GREEN)
    mask = ((near.rgb == GREEN).all(axis=-1)) & (ahead.rgb != 180).all(axis=-1)
    frame = Frame(
        np.where(mask[..., None], near.rgb, ahead.rgb),
        np.where(mask[..., None], near.points, ahead.points),
        np.where(mask, 9, ahead.segmap),
        near.K,
        near.T_world_cam,
    )
    assert by_colour(session(frame))[GREEN] not in ids.values()


def test_so_many_tracks_are_remembered_and_the_oldest_go_first():
    first, bare = scene(START), scene(START)
    nothing = hidden(hidden(hidden(bare, RED), GREEN), BLUE)
    few = replace(TRACK, lost=2)
    assert [each.object_id for each in lost_tracks(first, [], nothing, few)] == [1, 2]
    old = Lost(first, 8)
    assert lost_tracks(nothing, [old], nothing, few) == (old,)
    assert lost_tracks(first, [old], nothing, replace(TRACK, lost=0)) == ()


def test_nothing_is_found_where_nothing_was_lost():
    assert found_again([], scene(START), [1], TRACK) == {}
    assert found_again([Lost(scene(START), 1)], scene(START), [], TRACK) == {}
    assert found_again([Lost(scene(START), 2)], scene(START), [1, 2, 3], TRACK) == {2: 2}
