"""Where each point of a placed mesh is, against where it truly is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from table_scene import MESHES, T_WORLD_CAM, stored

from brrp_cli.evaluation.pose_error import POSE, pose_error, true_pose
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.reconstruction import Retrieved

T_WORLD_MESH = similarity(
    rotation=Rotation.from_rotvec([0.2, 0.5, 1.0]).as_matrix(), translation=np.array([0.1, 0, 0.2])
)


def truth_of(name, unit=1.0):
    """The object as a scene tells of it, with its mesh in metres or in another unit."""
    T_world_object = T_WORLD_MESH @ similarity(scale=unit)
    vertices = transform_points(T_WORLD_MESH, np.asarray(MESHES[name]().vertices))
    return true_pose(TrueObject(1, f"{name}.ply", T_world_object, unit), vertices, T_WORLD_CAM)


def found(name, T_mesh, truth):
    """A stored object whose mesh is moved by T_mesh (4, 4), in its own frame, from where it is."""
    own = stored(name)
    T_mesh_object = similarity(own.half_extent, translation=own.center)
    T_cam_object = np.linalg.inv(T_WORLD_CAM) @ T_WORLD_MESH @ T_mesh @ T_mesh_object
    return pose_error(Retrieved(name, 1.0, T_cam_object), own, truth)


@pytest.mark.parametrize("unit", [1.0, 0.001])
def test_what_lies_where_it_truly_is_is_off_by_nothing(unit):
    row = found("box", np.eye(4), truth_of("box", unit))
    assert set(row) == set(POSE)
    assert row["pose_error"] == pytest.approx(0, abs=1e-5)
    assert row["turn_error"] == pytest.approx(0, abs=0.01)
    assert row["diameter"] == pytest.approx(np.linalg.norm([0.10, 0.06, 0.14]), rel=1e-3)


def test_a_shift_is_as_far_as_it_goes():
    row = found("box", similarity(translation=np.array([0, 0.003, 0.004])), truth_of("box"))
    assert row["pose_error"] == pytest.approx(0.005, rel=1e-3)


def test_a_ball_that_is_turned_is_not_where_it_was():
    """Its surface is the same. Half a turn moves a point by twice its distance from the axis, which
    is pi/4 of the radius on average."""
    ball = similarity(rotation=Rotation.from_rotvec([0, 0, np.pi]).as_matrix())
    row = found("ball", ball, truth_of("ball"))
    assert row["pose_error"] == pytest.approx(np.pi / 2 * 0.05, rel=0.02)
    assert row["turn_error"] == pytest.approx(180, abs=0.1)


def test_the_least_error_is_of_all_poses_that_are_alike():
    own, truth = stored("ball"), truth_of("ball")
    turned = truth.T_cam_mesh @ similarity(rotation=Rotation.from_rotvec([0, 0, 2]).as_matrix())
    T_mesh_object = similarity(own.half_extent, translation=own.center)
    alone = Retrieved("ball", 1.0, turned @ T_mesh_object, size_factor=1.0)
    assert pose_error(alone, own, truth)["alike"] == 0
    told = replace(alone, alike=(turned, truth.T_cam_mesh))
    row = pose_error(told, own, truth)
    assert row["alike"] == 2
    assert row["pose_error"] > 0.05 and row["least_pose_error"] == pytest.approx(0, abs=1e-6)


def test_another_mesh_has_coordinates_of_its_own():
    truth = truth_of("box")
    assert found("box", np.eye(4), truth._replace(box=1.05 * truth.box)) == {}


def test_an_object_of_another_size_is_off_by_what_it_is_larger():
    own = stored("ball")
    truth = truth_of("ball")
    T_cam_object = truth.T_cam_mesh @ similarity(1.1 * own.half_extent, translation=own.center)
    row = pose_error(Retrieved("ball", 1.0, T_cam_object), own, truth)
    assert row["pose_error"] == pytest.approx(0.005, rel=0.01)
    assert row["turn_error"] == pytest.approx(0, abs=0.01)
