"""Where nothing in view changes, masks are not made again."""

from __future__ import annotations

import numpy as np
import pytest
from sphere_method import METHOD
from test_tracking import BLUE, GREEN, RED, START, A, colour_of, scene

from brrp_cli import Reconstructor
from brrp_cli.config.tracking import TrackConfig
from brrp_cli.errors import FrameError
from brrp_cli.methods.registry import METHODS
from brrp_cli.tracking.unchanged import unchanged

TRACK = TrackConfig()


def bare(*args, **kwargs):
    frame = scene(*args, **kwargs)
    return frame.without_masks()


@pytest.fixture
def made(monkeypatch):
    """The frames that masks were made of."""
    from brrp_cli.segmentation import segment as module

    frames, real = [], module.segment_and_aside

    def counted(frame, *args, **kwargs):
        frames.append(frame)
        return real(frame, *args, **kwargs)

    monkeypatch.setattr(module, "segment_and_aside", counted)
    monkeypatch.setitem(METHODS, METHOD.name, METHOD)
    return frames


def by_colour(result) -> dict[tuple[int, ...], int]:
    return {colour_of(result.frame, i): i for i in result.frame.object_ids}


def test_a_still_view_has_the_masks_of_the_last_frame(made):
    with Reconstructor(method="sphere", track=True) as session:
        first = session(bare(START, noise=0.001))
        for seed in (1, 2, 3):
            again = session(bare(START, noise=0.001, seed=seed))
        assert len(made) == 1
        assert np.array_equal(again.frame.segmap, first.frame.segmap)
        assert [i.posterior for i in again.objects] == [i.posterior for i in first.objects]
        assert again.segmentation == first.segmentation and again.seconds["masks"] == 0
        # One is moved: masks are made, and it alone is done again.
        moved = session(bare(START | {GREEN: (0.12, 0.13)}, noise=0.001, seed=4))
    assert len(made) == 2
    assert by_colour(moved) == by_colour(first)
    done = [i.object_id for i in moved.objects if i.seconds]
    assert done == [by_colour(first)[GREEN]]


def test_what_comes_goes_or_changes_its_colour_is_seen(made):
    with Reconstructor(method="sphere", track=True) as session:
        ids = by_colour(session(bare({RED: A, GREEN: START[GREEN]})))
        assert set(by_colour(session(bare(START)))) == {RED, GREEN, BLUE}
        gone = by_colour(session(bare({RED: A, BLUE: START[BLUE]})))
        assert set(gone) == {RED, BLUE} and gone[RED] == ids[RED]
        assert len(made) == 3
        session(bare({RED: A, (220, 210, 60): START[BLUE]}))
    assert len(made) == 4


def test_what_creeps_is_seen_in_the_end(made):
    """Half a centimetre a frame is less than noise: the newest frame is held to the one that masks
    were made of."""
    with Reconstructor(method="sphere", track=True) as session:
        for step in range(8):
            session(bare(START | {GREEN: (0.1 - 0.005 * step, 0.0)}))
    assert 2 <= len(made) <= 8


def test_what_slides_by_less_than_a_centimetre_is_seen_at_its_borders(made):
    with Reconstructor(method="sphere", track=True) as session:
        ids = by_colour(session(bare(START, noise=0.001)))
        slid = session(bare(START | {GREEN: (0.1, 0.008)}, noise=0.001, seed=1))
    assert len(made) == 2 and by_colour(slid) == ids
    assert [item.object_id for item in slid.objects if item.seconds] == [ids[GREEN]]


def test_a_camera_that_goes_sees_another_view():
    first = scene(START, known=True)
    assert unchanged(first, scene(START, known=True), TRACK)
    assert not unchanged(first, scene(START, yaw=0.45, known=True), TRACK)
    assert not unchanged(scene(START), scene(START, yaw=0.6), TRACK)


def test_masks_that_come_with_a_frame_are_never_replaced(made):
    with Reconstructor(method="sphere", track=True) as session:
        session(bare(START))
        given = scene(START)
        two = given.with_masks(np.where(given.segmap == 3, 0, given.segmap))
        assert len(session(two).objects) == 2
        session(bare(START))
    assert len(made) == 2, "those of the last frame were not made here"


def test_masks_of_a_frame_that_failed_are_no_ones(made, monkeypatch):
    empty, full = scene({RED: A}), scene(START)
    shown = bare(START)
    with Reconstructor(method="sphere", track=True) as session:
        session(bare({RED: A}))
        monkeypatch.setattr(session, "_mended", _fails)
        with pytest.raises(FrameError):
            session(shown)
        monkeypatch.undo()
        monkeypatch.setitem(METHODS, METHOD.name, METHOD)
        assert len(session(shown).objects) == len(full.object_ids) != len(empty.object_ids)


def _fails(*args, **kwargs):
    raise FrameError("nothing is left")
