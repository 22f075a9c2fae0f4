"""Turns of a model about itself."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from brrp_cli.config.turns import MainAxesConfig
from brrp_cli.registration.turns import about_main_axes, best_and_different, turns_about_itself

AXES = MainAxesConfig()


def test_turns_begin_with_none_hold_upside_down_and_come_once() -> None:
    matrices = turns_about_itself(8)
    np.testing.assert_array_equal(matrices[0], np.eye(3))
    assert any(np.allclose(each, np.diag([1, -1, -1])) for each in matrices)
    turns = Rotation.from_matrix(matrices)
    apart = [(turns[i].inv() * turns).magnitude() for i in range(len(turns))]
    assert np.min(np.array(apart) + 10 * np.eye(len(turns))) > 0.1


def test_a_front_is_not_crowded_out_by_a_back_that_is_turned_a_little() -> None:
    turns = Rotation.from_rotvec(np.outer([0.0, 0.1, 0.2, np.pi, 3.0], [0, 0, 1])).as_matrix()
    score = np.array([0.9, 0.8, 0.7, 0.5, 0.4])
    assert best_and_different(turns, score, 3, 0.5).tolist() == [0, 3, 1]
    assert best_and_different(turns, score, 9, 0.0).tolist() == [0, 1, 2, 3, 4]


def test_an_object_that_was_scanned_askew_turns_about_its_own_axes() -> None:
    """A bar of a square section, off the middle: about its length, and end over end."""
    rng = np.random.default_rng(0)
    bar = rng.uniform(-1, 1, (4000, 3)) * [0.10, 0.01, 0.01]
    askew = Rotation.from_rotvec([0.1, 0.2, 0.5])
    shift = np.array([0.02, 0.0, 0.01])
    T = about_main_axes(askew.apply(bar) + shift, 4, AXES)
    assert len(T) == 8
    # In the bar's own frame, about its own middle.
    own = np.eye(4)
    own[:3, :3], own[:3, 3] = askew.as_matrix(), shift
    inside = np.linalg.inv(own) @ T @ own
    along = inside[:, 0, 0]
    np.testing.assert_allclose(np.abs(along), 1, atol=0.01)
    assert (along > 0).sum() == (along < 0).sum() == 4
    np.testing.assert_allclose(inside[:, :3, 3], 0, atol=0.003)


def test_an_object_that_lies_along_its_box_has_no_other_axes() -> None:
    rng = np.random.default_rng(0)
    box = rng.uniform(-1, 1, (4000, 3)) * [0.10, 0.05, 0.02]
    assert about_main_axes(box, 4, AXES).shape == (0, 4, 4)
    ball = rng.normal(size=(4000, 3))
    assert about_main_axes(ball / np.linalg.norm(ball, axis=1)[:, None], 4, AXES).shape == (0, 4, 4)
