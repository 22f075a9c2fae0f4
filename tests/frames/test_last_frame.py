"""What is asked twice of one frame is computed once, and of another one anew."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_frame


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


def test_depth_is_that_of_the_points_in_one_piece_and_cannot_be_changed(frame):
    np.testing.assert_array_equal(frame.depth, frame.points[..., 2])
    assert frame.depth.flags.c_contiguous and not frame.depth.flags.writeable
