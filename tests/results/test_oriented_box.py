"""The smallest box of a mesh: its pose and sizes are those of a box that is known."""

import numpy as np
import pytest
import trimesh

from brrp_cli.geometry import transform_points
from brrp_cli.results.write import _oriented_box


@pytest.mark.parametrize("seed", range(3))
def test_a_turned_box_gets_its_own_pose_back(seed):
    T = trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3))
    T[:3, 3] = 0.1, -0.2, 0.8
    mesh = trimesh.creation.box((0.05, 0.2, 0.1)).subdivide().apply_transform(T)
    found = _oriented_box(np.asarray(mesh.vertices))
    assert found["extents"] == pytest.approx([0.2, 0.1, 0.05], abs=1e-9)
    T_frame_box = np.array(found["T_frame_box"])
    R = T_frame_box[:3, :3]
    assert pytest.approx(np.eye(3), abs=1e-9) == R @ R.T and np.linalg.det(R) > 0
    assert T_frame_box[:3, 3] == pytest.approx([0.1, -0.2, 0.8], abs=1e-9)
    inside = transform_points(np.linalg.inv(T_frame_box), mesh.vertices)
    assert np.abs(inside).max(axis=0) == pytest.approx([0.1, 0.05, 0.025], abs=1e-9)
    assert abs(R[:, 0] @ T[:3, 1]) == pytest.approx(1, abs=1e-9)


def test_what_is_flat_has_a_box_too():
    corners = np.array(
        [[0.0, 0, 0.5], [0.2, 0, 0.5], [0.2, 0.1, 0.5], [0, 0.1, 0.5], [0.1, 0, 0.5]]
    )
    found = _oriented_box(corners)
    inside = transform_points(np.linalg.inv(found["T_frame_box"]), corners)
    assert (np.abs(inside) <= np.array(found["extents"]) / 2 + 1e-6).all()
    assert found["extents"][2] == pytest.approx(0, abs=1e-6)
