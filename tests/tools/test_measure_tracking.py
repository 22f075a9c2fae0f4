"""The sequence that sessions are measured on is what it says it is."""

from __future__ import annotations

import numpy as np
from measure_tracking import MOVED_IN, ROUND_FROM, sequence, true_objects


def test_one_object_moves_in_one_frame_and_the_camera_from_another_on():
    shown = list(sequence(3, ROUND_FROM + 1, 3))
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
            next(m for i, m in poses[f].values() if i == number).vertices
            for f in (MOVED_IN - 1, MOVED_IN)
        )
        assert np.allclose(before, after) == (number != 0)
    again = next(sequence(3, 1, 3))
    assert np.array_equal(again.frame.points, shown[0].frame.points, equal_nan=True)
    assert not np.array_equal(shown[0].frame.points, shown[1].frame.points, equal_nan=True), (
        "each frame has noise of its own"
    )
