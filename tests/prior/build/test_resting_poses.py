import numpy as np
import pytest
import trimesh

from brrp_cli.geometry import transform_points
from brrp_cli.prior.build.resting_poses import resting_poses
from brrp_cli.prior.parameters import PoseConfig


def test_a_box_rests_on_its_six_faces_most_on_the_largest() -> None:
    box = trimesh.creation.box((0.10, 0.06, 0.04))
    box.apply_translation((0.3, -0.2, 0.5))
    poses = resting_poses(box, PoseConfig())
    assert len(poses) == 6
    assert sum(pose.probability for pose in poses) == pytest.approx(1.0, abs=1e-6)
    heights = []
    for pose in poses:
        on_plane = transform_points(pose.T_plane_object, box.vertices)
        assert on_plane[:, 2].min() == pytest.approx(0.0, abs=1e-9)
        assert (on_plane[:, 2] < 1e-9).sum() == 4
        rotation = pose.T_plane_object[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        heights.append(np.ptp(on_plane[:, 2]))
    np.testing.assert_allclose(heights, [0.04, 0.04, 0.06, 0.06, 0.10, 0.10])


def test_a_rolling_can_gets_a_handful_of_poses() -> None:
    can = trimesh.creation.cylinder(radius=0.04, height=0.10, sections=128)
    poses = resting_poses(can, PoseConfig())
    assert 6 < len(poses) <= 12
    lying = [pose for pose in poses if abs(pose.T_plane_object[2, 2]) < 0.2]
    standing = [pose for pose in poses if abs(pose.T_plane_object[2, 2]) > 0.99]
    assert len(lying) + len(standing) == len(poses)
    assert standing


def test_a_ball_has_at_least_one_pose_and_all_its_points_above_the_plane() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    poses = resting_poses(ball, PoseConfig(min_probability=0.5))
    assert len(poses) == 1
    lowest = transform_points(poses[0].T_plane_object, ball.vertices)[:, 2].min()
    assert lowest == pytest.approx(0.0, abs=1e-9)


def test_what_rests_on_many_slivers_loses_no_pose() -> None:
    # Faces cut into many leave rounded vertices a hair beside one another on the hull.
    box = trimesh.creation.box((0.2, 0.05, 0.01))
    for _ in range(5):
        box = box.subdivide()
    box.apply_transform(trimesh.transformations.rotation_matrix(0.3, [1, 2, 3]))
    box.vertices = box.vertices.astype(np.float32).astype(np.float64)
    of_many = resting_poses(box, PoseConfig())
    of_twelve = resting_poses(box.convex_hull.bounding_box_oriented, PoseConfig())
    assert [pose.probability for pose in of_many] == pytest.approx(
        [pose.probability for pose in of_twelve], abs=1e-3
    )
    assert sum(pose.probability for pose in of_many) == pytest.approx(1.0, abs=0.01)
