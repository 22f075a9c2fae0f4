"""The sequence that sessions are measured on is what it says it is."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from measure_tracking import Course, sequence, shapes_of, surface_distance, true_objects


def test_one_object_moves_in_one_frame_and_the_camera_from_another_on():
    course = Course(moved_in=2, round_from=4)
    shown = list(sequence(3, 5, 3, course))
    for each in shown:
        assert true_objects(each, each.frame.segmap) == {
            place: number for place, (number, _) in each.truth.items()
        }
        columns = [np.nonzero(each.frame.segmap == i)[1].mean() for i in each.frame.object_ids]
        assert columns == sorted(columns), "masks are numbered from left to right"
    still = shown[0].frame.T_world_cam
    assert [np.allclose(each.frame.T_world_cam, still) for each in shown] == [True] * 4 + [False]
    poses = [each.truth for each in shown]
    for number in range(3):
        before, after = (
            next(m for i, m in poses[f].values() if i == number).vertices for f in (1, 2)
        )
        assert np.allclose(before, after) == (number != 0)
    again = next(sequence(3, 1, 3, course))
    assert np.array_equal(again.frame.points, shown[0].frame.points, equal_nan=True)
    assert not np.array_equal(shown[0].frame.points, shown[1].frame.points, equal_nan=True), (
        "each frame has noise of its own"
    )


def test_half_of_the_objects_are_in_the_prior_and_all_stand_on_the_table():
    shapes = shapes_of(3, 5)
    assert [bool(shape.name) for shape in shapes] == [True, True, True, False, False]
    assert all(abs(shape.mesh.bounds[0, 2]) < 1e-6 for shape in shapes)


def test_the_distance_of_two_surfaces_is_what_one_was_grown_by():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    grown = trimesh.creation.icosphere(subdivisions=4, radius=0.052)
    assert surface_distance(grown, ball, 0) == pytest.approx(0.002, rel=0.02)


def test_a_pose_that_is_off_is_off_by_as_much():
    right, wrong = (
        [each.frame.T_world_cam for each in sequence(3, 2, 2, Course(pose_error=error))]
        for error in (0.0, 0.003)
    )
    off = [np.linalg.norm(a[:3, 3] - b[:3, 3]) for a, b in zip(right, wrong, strict=True)]
    assert 0.001 < np.mean(off) < 0.006
