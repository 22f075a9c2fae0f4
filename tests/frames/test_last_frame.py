"""What is asked twice of one frame is computed once, and of another one anew."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_frame, kept_for_last_image


@pytest.fixture
def frame():
    points = np.random.default_rng(0).uniform(0.5, 1, (4, 5, 3)).astype(np.float32)
    points[1, 2] = np.nan
    return Frame(np.zeros((4, 5, 3), np.uint8), points, np.zeros((4, 5), np.int64), np.eye(3))


@pytest.fixture
def counted():
    calls = []

    @kept_for_last_frame
    def first_depth(frame, times, what=None):
        calls.append(times)
        return times * float(frame.points[0, 0, 2])

    return first_depth, calls


def test_the_same_question_is_answered_once(frame, counted):
    asked, calls = counted
    large = 10**12
    assert asked(frame, large) == asked(frame, 10**12) == large * float(frame.points[0, 0, 2])
    assert calls == [large]


def test_another_frame_or_question_is_answered_anew(frame, counted):
    asked, calls = counted
    nearer = replace(frame, points=frame.points / 2)
    answers = [asked(frame, 1), asked(nearer, 1), asked(frame, 1), asked(frame, 2)]
    assert answers == [answers[0], answers[0] / 2, answers[0], 2 * answers[0]]
    assert calls == [1, 1, 1, 2]
    assert asked(frame, 2, None) == asked(frame, times=2) == 2 * answers[0]


def test_a_frame_is_not_kept_alive(frame, counted):
    asked, _ = counted
    other = replace(frame)
    asked(other, 1)
    gone = weakref.ref(other)
    del other
    gc.collect()
    assert gone() is None


class Answer:
    """Something that can be seen to be gone."""


@pytest.mark.parametrize("kept", [kept_for_last_frame, kept_for_last_image])
def test_the_answer_goes_with_the_frame(frame, kept):
    asked = kept(lambda frame: Answer())
    other = replace(frame)
    answer = weakref.ref(asked(other))
    assert answer() is asked(other)
    del other
    gc.collect()
    assert answer() is None


def test_other_masks_of_an_image_are_the_same_question_and_another_image_is_not(frame):
    calls = []

    @kept_for_last_image
    def mean_colour(frame):
        calls.append(frame)
        return float(frame.rgb.mean())

    masked = frame.with_masks(np.ones((4, 5), np.int64))
    assert mean_colour(frame) == mean_colour(masked) == 0
    assert len(calls) == 1
    assert mean_colour(replace(frame, rgb=frame.rgb + np.uint8(7))) == 7
    mean_colour(frame.with_points(frame.points / 2))
    assert len(calls) == 3


def test_depth_is_that_of_the_points_in_one_piece_and_cannot_be_changed(frame):
    np.testing.assert_array_equal(frame.depth, frame.points[..., 2])
    assert frame.depth.flags.c_contiguous and not frame.depth.flags.writeable
