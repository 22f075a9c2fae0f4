"""Registration recovers a known pose and scale of a mesh from a partial view."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from stored_example import example

from brrp_cli.config import FeatureConfig, RegistrationConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.descriptors.fpfh import fpfh_cloud
from brrp_cli.geometry import transform_points
from brrp_cli.registration.scale_scan import observed_cloud, register

# Steps of a fifth: neighbouring scales of the full scan are told apart only by whole views.
FEATURES = FeatureConfig(scales=(0.65, 0.8, 1.0, 1.22))
CONFIG = RegistrationConfig()


def drill():
    """A barrel, a grip and a battery: curved, without symmetry, half-extent 1 when normalised."""
    barrel = trimesh.creation.cylinder(radius=0.3, height=1.9, sections=48)
    barrel.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    grip = trimesh.creation.cylinder(radius=0.2, height=1.2, sections=48)
    grip.apply_transform(trimesh.transformations.rotation_matrix(0.3, [0, 1, 0]))
    grip.apply_translation([0.45, 0, -0.7])
    battery = trimesh.creation.box([0.9, 0.5, 0.3])
    battery.apply_translation([0.3, 0.1, -1.3])
    mesh = trimesh.boolean.union([barrel, grip, battery])
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    mesh.apply_scale(2 / mesh.extents.max())
    return mesh


def stored(mesh):
    points, faces = trimesh.sample.sample_surface(mesh, 20_000, seed=0)
    normals = mesh.face_normals[faces]
    clouds = {
        scale: fpfh_cloud(points * FEATURES.base_scale * scale, FEATURES, normals=normals)
        for scale in FEATURES.scales
    }
    return replace(example("drill"), clouds=clouds)


def seen_from_the_origin(mesh):
    """Points of a mesh that a camera at the origin sees, looking along z."""
    o3d = import_open3d()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(mesh.vertices.astype(np.float32)),
        o3d.core.Tensor(mesh.faces.astype(np.uint32)),
    )
    K = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    rays = scene.create_rays_pinhole(o3d.core.Tensor(K), o3d.core.Tensor(np.eye(4)), 640, 480)
    distance = scene.cast_rays(rays)["t_hit"].numpy()
    rays = rays.numpy()
    hit = np.isfinite(distance)
    return rays[hit][:, :3] + rays[hit][:, 3:] * distance[hit][:, None]


@pytest.mark.parametrize(("scale", "seed"), [(0.8, 0), (1.0, 1), (0.8, 2)])
def test_recovers_pose_and_scale_from_a_partial_view(scale, seed):
    mesh = drill()
    rotation = trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3))
    T_cam_object = rotation.copy()
    T_cam_object[:3, :3] *= FEATURES.base_scale * scale
    T_cam_object[:3, 3] = [0.03, -0.05, 0.7]
    placed = mesh.copy()
    placed.apply_transform(T_cam_object)

    observed = observed_cloud(seen_from_the_origin(placed), FEATURES)
    found = register(observed, stored(mesh), FEATURES, CONFIG, seed)

    assert found.scale == scale
    error = transform_points(found.T_cam_object, mesh.vertices) - placed.vertices
    assert np.linalg.norm(error, axis=1).max() < 0.015
    assert 0 < found.fitness <= 1


def test_same_seed_same_placement():
    mesh = drill()
    observed = observed_cloud(seen_from_the_origin(placed_at(mesh, 0.1)), FEATURES)
    first, second = (register(observed, stored(mesh), FEATURES, CONFIG, 3) for _ in range(2))
    np.testing.assert_array_equal(first.T_cam_object, second.T_cam_object)


def test_no_inlier_at_any_scale_gives_no_placement():
    """A handful of collinear points matches nothing of a drill."""
    line = np.linspace([0, 0, 0.7], [0.0, 3.0, 0.7], 4)
    observed = observed_cloud(line, FEATURES)
    assert register(observed, stored(drill()), FEATURES, CONFIG, 0) is None


def placed_at(mesh, size):
    placed = mesh.copy()
    placed.apply_scale(size)
    placed.apply_translation([0, 0, 0.7])
    return placed


def test_features_are_oriented_towards_the_camera():
    observed = observed_cloud(seen_from_the_origin(placed_at(drill(), 0.1)), FEATURES)
    towards = -(observed.cloud.points + observed.center)
    assert (np.einsum("ij,ij->i", observed.cloud.normals, towards) > 0).all()
    assert observed.cloud.fpfh.shape == (len(observed.cloud.points), 33)
