"""What a camera sees of known meshes."""

import numpy as np
import trimesh

from brrp_cli.geometry import backproject
from brrp_cli.raycast import look

K = np.array([[100.0, 0, 32], [0, 100, 24], [0, 0, 1]])


def ball(radius, center):
    mesh = trimesh.creation.icosphere(5, radius)
    mesh.apply_translation(center)
    return mesh


def test_depth_is_along_z_and_points_lie_on_the_surface():
    center = np.array([0.1, -0.05, 1.0])
    sight = look([ball(0.15, center)], K, (48, 64))
    hit = sight.index == 0
    points = backproject(sight.depth, K)[hit]
    np.testing.assert_allclose(np.linalg.norm(points - center, axis=1), 0.15, atol=5e-4)
    # On the optical axis' pixel of the centre the depth is the ball's near pole, nearly.
    assert hit[19, 42]
    assert not hit[0, 0]
    assert sight.depth[0, 0] == 0


def test_a_wall_has_one_depth_everywhere_although_rays_differ_in_length():
    wall = trimesh.creation.box((10, 10, 0.2))
    wall.apply_translation((0, 0, 2.1))
    sight = look([wall], K, (48, 64))
    np.testing.assert_allclose(sight.depth, 2.0, atol=1e-5)
    np.testing.assert_allclose(sight.normals, np.broadcast_to([0, 0, -1], (48, 64, 3)), atol=1e-6)


def test_the_nearer_mesh_wins_and_x_is_right_and_y_is_down():
    near, far = ball(0.1, (0.2, 0.1, 1.0)), ball(0.4, (0, 0, 2.0))
    sight = look([far, near], K, (48, 64))
    assert sight.index[34, 52] == 1
    assert sight.index[24, 32] == 0
    assert sight.index[0, 0] == -1
