"""Depth that is taken away, and the table of what becomes of it."""

import numpy as np
import pytest
from measure_missing_depth import Row, table, with_patches
from table_scene import MESHES, in_camera, photograph, placed


@pytest.mark.parametrize("left", [0.3, 0.02])
def test_patches_hold_the_share_of_each_object_and_nothing_else_is_lost(left):
    things = {
        3: in_camera(MESHES["box"](), placed(-0.1, 0.05, 0.3)),
        8: in_camera(MESHES["ball"](), placed(0.1, -0.05, 0.0)),
    }
    frame = photograph(things)
    patched = with_patches(frame, left, "scene")
    for object_id in things:
        own = frame.segmap == object_id
        before = (own & frame.valid).sum()
        assert (own & patched.valid).sum() == pytest.approx(left * before, abs=1.5)
    rest = frame.segmap == 0
    np.testing.assert_array_equal(patched.valid[rest], frame.valid[rest])
    kept = patched.valid
    np.testing.assert_array_equal(patched.points[kept], frame.points[kept])


def test_each_bin_counts_its_objects_alone():
    right = Row("a", 0.1, True, False, 0.001, 1.0, 0.002**2, 0.004**2)
    lost = Row("b", 0.1, False, False, np.nan, 0.0, np.nan, np.nan)
    wrong = Row("b", 0.9, False, True, 0.02, 0.1, 0.003**2, 0.02**2)
    few, many = table("set", [right, lost, wrong])
    assert few.startswith("| set | 5 to 20 % | 2 | 50 % | 0 % | 50 % | 1.00, 1.00 | 0.500 [")
    assert few.endswith("| 2.0, 4.0 |")
    assert (
        many == "| set | 60 to 100 % | 1 | 0 % | 100 % | 0 % | 20.00, 20.00 | 0.100 | 3.0, 20.0 |"
    )
