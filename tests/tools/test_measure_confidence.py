"""The tool that counts how often true objects lie inside confidence surfaces."""

import numpy as np
import pytest
import trimesh

pytest.importorskip("point_cloud_utils")
from measure_confidence import _outside


def test_what_a_mesh_holds_twice_is_inside():
    ball = trimesh.creation.icosphere(3, 1.0)
    beside = ball.copy()
    beside.apply_translation([0.5, 0, 0])
    both = trimesh.util.concatenate([ball, beside])
    points = np.array([[-0.9, 0, 0], [0.25, 0, 0], [1.4, 0, 0], [3.0, 0, 0]])
    found = _outside(both.vertices, both.faces, points)
    assert (found[:3] < 0).all()
    assert found[0] == pytest.approx(-0.1, abs=0.01) and found[3] == pytest.approx(1.5, abs=0.01)
