"""MoveIt's planning scene, read as MoveIt reads it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from made_result import BOX, ELL, truth, write_made_result
from moveit_messages import message, pose_matrix, read_scene
from table_scene import T_WORLD_CAM

from brrp_cli.cli import main
from brrp_cli.geometry import transform_points
from brrp_cli.planning.parts import beyond_hull

NAMES = {"table", f"object_{BOX}", f"object_{ELL}"}


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, [*map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """In the world's frame, with grasps, and shapes of 95 %."""
    results = write_made_result(tmp_path_factory.mktemp("made") / "out", frame="world")
    assert run("grasp", results, "--per-object", 3)[0] == 0
    code, output = run(
        "export", results, "--collision", "hull", "--confidence", 0.95, "--moveit",
        "--frame-id", "base_link",
    )  # fmt: skip
    assert code == 0 and "moveit.scene" in output
    return results / "plan"


def grasps(folder: Path) -> dict[str, list[dict]]:
    record = json.loads((folder.parent / "grasps.json").read_text())
    return {f"object_{item['id']}": item["grasps"] for item in record["objects"]}


def test_the_text_holds_the_true_objects_the_table_and_the_grasps(folder):
    name, objects = read_scene((folder / "moveit.scene").read_text())
    assert name and set(objects) == NAMES
    for object_id, mesh in truth().items():
        item = objects[f"object_{object_id}"]
        (hull,) = item.shapes
        assert hull.is_watertight and hull.volume > 0
        placed = transform_points(item.T, hull.vertices)
        assert beyond_hull(placed, transform_points(T_WORLD_CAM, mesh.vertices)).max() < 0
        found = grasps(folder)[f"object_{object_id}"]
        assert list(item.subframes) == [f"grasp_{i}" for i in range(len(found))] and found
        for T, grasp in zip(item.subframes.values(), found, strict=True):
            np.testing.assert_allclose(item.T @ T, grasp["T_world_gripper"], atol=1e-6)
        assert np.min(item.colours) >= 0 and np.max(item.colours) <= 1
    table = objects["table"]
    top = table.shapes[0].copy().apply_transform(table.T)
    assert top.bounds[1, 2] == pytest.approx(0, abs=1e-6)


def test_the_message_is_the_same_scene(folder):
    pytest.importorskip("rosbags")
    _, objects = read_scene((folder / "moveit.scene").read_text())
    scene = message(
        "moveit_msgs/msg/PlanningScene", json.loads((folder / "moveit.json").read_text())
    )
    assert scene.is_diff and scene.robot_state.is_diff
    assert {item.id for item in scene.world.collision_objects} == NAMES
    assert {item.id for item in scene.object_colors} == NAMES
    for item in scene.world.collision_objects:
        told = objects[item.id]
        assert item.header.frame_id == "base_link" and item.operation == 0
        np.testing.assert_allclose(pose_matrix(item.pose), told.T, atol=1e-6)
        assert len(item.meshes) == len(item.mesh_poses)
        assert len(item.primitives) == len(item.primitive_poses)
        for mesh, place, shape in zip(item.meshes, item.mesh_poses, told.shapes, strict=False):
            vertices = np.array([[v.x, v.y, v.z] for v in mesh.vertices])
            faces = np.array([t.vertex_indices for t in mesh.triangles])
            read = trimesh.Trimesh(vertices, faces, process=False)
            read.apply_transform(pose_matrix(place))
            np.testing.assert_allclose(read.vertices, shape.vertices, atol=1e-6)
            assert read.volume == pytest.approx(shape.volume, rel=1e-4)
        for box in item.primitives:
            assert box.type == 1
            np.testing.assert_allclose(box.dimensions, told.shapes[0].extents, atol=1e-6)
        frames = dict(zip(item.subframe_names, item.subframe_poses, strict=True))
        assert list(frames) == list(told.subframes)
        for key, place in frames.items():
            np.testing.assert_allclose(pose_matrix(place), told.subframes[key], atol=1e-6)


def test_grasps_are_messages_too(folder):
    pytest.importorskip("rosbags")
    record = json.loads((folder / "moveit_grasps.json").read_text())
    for name, found in grasps(folder).items():
        assert len(record[name]) == len(found)
        for told, grasp in zip(record[name], found, strict=True):
            read = message("moveit_msgs/msg/Grasp", told)
            T = pose_matrix(read.grasp_pose.pose)
            np.testing.assert_allclose(T, grasp["T_world_gripper"], atol=1e-6)
            assert read.grasp_quality == grasp["score"]
            way = read.pre_grasp_approach.direction
            towards = [way.vector.x, way.vector.y, way.vector.z]
            np.testing.assert_allclose(towards, T[:3, 2], atol=1e-6)
            assert way.header.frame_id == read.grasp_pose.header.frame_id == "base_link"
            assert read.pre_grasp_approach.desired_distance == pytest.approx(0.1)
            assert read.post_grasp_retreat.direction.vector.z == pytest.approx(1)


def test_without_grasps_there_are_no_frames_and_the_frame_is_that_of_the_results(tmp_path):
    results = write_made_result(tmp_path / "out")
    assert run("export", results, "--collision", "hull", "--moveit")[0] == 0
    _, objects = read_scene((results / "plan" / "moveit.scene").read_text())
    assert all(item.subframes == {} for item in objects.values())
    assert not (results / "plan" / "moveit_grasps.json").exists()
    told = json.loads((results / "plan" / "moveit.json").read_text())
    assert {i["header"]["frame_id"] for i in told["world"]["collision_objects"]} == {"camera"}
    (results / "grasps.json").write_text('{"frame": "camera"}')
    code, output = run("export", results, "--collision", "hull", "--moveit", "--overwrite")
    assert code == 1 and "grasps cannot be read" in output and "brrp grasp" in output
    assert run("export", results, "--frame-id", "base_link")[0] == 2
