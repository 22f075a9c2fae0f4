"""The demo's frame agrees with its truth."""

import numpy as np
import pytest

from brrp_cli.demo.layout import GAP, camera_pose, stand_apart
from brrp_cli.demo.scene import INTRINSICS, LIGHT_WORLD, SHAPE, make_scene, shade
from brrp_cli.geometry import project, transform_points
from brrp_cli.ground_truth.metrics import nearest_distances, sample_surface
from brrp_cli.raycast import look
from brrp_cli.shapes import solids
from brrp_cli.shapes.household import household_shapes, household_variations


@pytest.fixture(scope="module")
def scene():
    return make_scene(0)


def test_the_camera_looks_at_its_target_from_above_with_up_upwards():
    target = np.array([0.1, 0.2, 0.3])
    T = camera_pose(target, distance=0.9, pitch=np.deg2rad(40), yaw=1.0)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
    T_cam_world = np.linalg.inv(T)
    np.testing.assert_allclose(transform_points(T_cam_world, target), [0, 0, 0.9], atol=1e-12)
    above = transform_points(T_cam_world, target + np.array([0, 0, 0.1]))
    assert above[1] < 0
    assert above[0] == pytest.approx(0)
    assert T[2, 3] - target[2] == pytest.approx(0.9 * np.sin(np.deg2rad(40)))


def test_objects_stand_on_the_plane_apart_from_each_other():
    meshes = [solids.cylinder(0.05, 0.1), solids.box(0.1, 0.06, 0.2), solids.ball(0.03)]
    for seed in range(20):
        poses = stand_apart(meshes, np.random.default_rng(seed))
        assert poses is not None
        placed = [m.copy().apply_transform(T) for m, T in zip(meshes, poses, strict=True)]
        for mesh in placed:
            assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-12)
        for i, mesh in enumerate(placed):
            for other in placed[i + 1 :]:
                gap = nearest_distances(mesh.vertices[:, :2], other.vertices[:, :2]).min()
                assert gap >= GAP


def test_what_does_not_fit_is_not_placed():
    huge = solids.cylinder(0.5, 0.1)
    assert stand_apart([huge, huge], np.random.default_rng(0)) is None


def test_the_scene_holds_stored_objects_and_a_variation(scene):
    stored = {shape.name for shape in household_shapes()}
    varied = {shape.name for shape in household_variations()}
    names = set(scene.names.values())
    assert len(names) == 5
    assert len(names & stored) == 4
    assert len(names & varied) == 1
    assert scene.frame.object_ids == sorted(scene.truth) == sorted(scene.names)


def test_pixels_of_each_object_lie_on_its_true_mesh_within_sensor_noise(scene):
    for object_id, mesh in scene.truth.items():
        points = scene.frame.object_points(object_id)
        assert len(points) > 1000
        surface = sample_surface(mesh, 20_000, np.random.default_rng(0))
        distance = nearest_distances(points[::10], surface)
        assert np.median(distance) < 0.004
        assert np.quantile(distance, 0.99) < 0.02


def test_clean_depth_lies_on_the_truth_exactly(scene):
    for object_id, mesh in scene.truth.items():
        seen = project(mesh.vertices, INTRINSICS)
        rows, columns = np.nonzero(look([mesh], INTRINSICS, SHAPE).index == 0)
        low, high = seen.min(axis=0), seen.max(axis=0)
        assert (columns >= low[0] - 1).all() and (columns <= high[0] + 1).all()
        assert (rows >= low[1] - 1).all() and (rows <= high[1] + 1).all()
        mask = scene.frame.segmap == object_id
        assert mask.sum() >= 0.5 * len(rows)


def test_truth_is_closed_and_stands_on_the_table(scene):
    T_world_cam = scene.frame.T_world_cam
    for mesh in scene.truth.values():
        assert mesh.is_watertight
        assert mesh.volume > 0
        assert transform_points(T_world_cam, mesh.vertices)[:, 2].min() == pytest.approx(
            0, abs=1e-9
        )


def test_the_table_is_the_background_around_z_zero(scene):
    frame = scene.frame
    background = frame.points[frame.valid & (frame.segmap == 0)].astype(np.float64)
    height = transform_points(frame.T_world_cam, background)[:, 2]
    assert np.mean(np.abs(height) < 0.01) > 0.5
    assert np.median(height[np.abs(height) < 0.05]) == pytest.approx(0, abs=1e-3)


def test_same_seed_same_bytes_and_seeds_differ(scene):
    again, other = make_scene(0), make_scene(1)
    for name in ("rgb", "points", "segmap"):
        assert getattr(again.frame, name).tobytes() == getattr(scene.frame, name).tobytes()
    assert other.frame.points.tobytes() != scene.frame.points.tobytes()


def test_shading_is_full_towards_the_light_and_ambient_away_from_it():
    plate = solids.moved(solids.box(4, 4, 0.1), z=1.0)
    sight = look([plate], INTRINSICS, SHAPE)
    towards = shade(sight, [(200, 100, 50)], np.array([0, 0, -1.0]))
    away = shade(sight, [(200, 100, 50)], np.array([0, 0, 1.0]))
    np.testing.assert_array_equal(towards[240, 320], [200, 100, 50])
    np.testing.assert_array_equal(away[240, 320], [80, 40, 20])
    assert np.linalg.norm(LIGHT_WORLD) == pytest.approx(1)
