"""A wall behind the table in what `brrp export` writes, and in what `brrp grasp` keeps out of."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from exported import exported, swept
from moveit_messages import message, read_scene

from brrp_cli.api import open_result
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.hidden_space import NOTHING_HIDDEN
from brrp_cli.grasping.plan import plan_grasps
from brrp_cli.grasping.scene import scene_of

# Behind the things of the made result, square to the line of sight of their camera.
YAW, BEHIND, THICK, HEIGHT = 0.4, 0.13, 0.02, 0.5


def wall_mesh() -> trimesh.Trimesh:
    wall = trimesh.creation.box((THICK, 2.0, HEIGHT))
    wall.apply_translation([-BEHIND - THICK / 2, 0.0, HEIGHT / 2])
    return wall.apply_transform(trimesh.transformations.rotation_matrix(YAW, [0, 0, 1]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    pytest.importorskip("mujoco")
    return exported(tmp_path_factory.mktemp("made"), wall_mesh())


def on_the_wall(points: np.ndarray) -> bool:
    """Whether points (n, 3), world, lie between the wall's faces, to a few millimetres."""
    along = points @ [np.cos(YAW), np.sin(YAW), 0.0]
    low, high = -BEHIND - THICK, -BEHIND
    return bool(
        along.min() > low - 0.004
        and along.max() < high + 0.004
        and np.ptp(points @ [-np.sin(YAW), np.cos(YAW), 0.0]) > 0.5
        and points[:, 2].min() < 0.03
    )


def test_every_file_has_it(folder):
    record = json.loads((folder / "plan.json").read_text())
    (one,) = record["table"]["walls"]
    assert one["name"] == "wall_1" and on_the_wall(np.array(one["corners"]))
    assert record["table"]["bins"] == []
    _, objects = read_scene((folder / "moveit.scene").read_text())
    (shape,) = objects["wall_1"].shapes
    assert on_the_wall(transform_points(objects["wall_1"].T, shape.vertices))
    scene = json.loads((folder / "moveit.json").read_text())
    message("moveit_msgs/msg/PlanningScene", scene)
    assert "wall_1" in {each["id"] for each in scene["world"]["collision_objects"]}
    stored = yaml.safe_load((folder / "world.yml").read_text())["mesh"]["wall_1"]
    mesh = trimesh.Trimesh(stored["vertices"], stored["faces"], process=False)
    assert mesh.is_watertight and on_the_wall(mesh.vertices)
    assert "wall_1" in trimesh.load_scene(folder / "scene.glb").geometry


def test_it_cannot_move_in_the_simulator_and_the_table_does_not_grow_with_it(folder):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    body = model.geom_bodyid[model.geom("wall_1").id]
    assert model.body_dofnum[body] == 0
    table = json.loads((folder / "plan.json").read_text())["table"]
    assert max(table["size"]) < 1.2


def test_hands_keep_out_of_it(folder):
    scene = scene_of(open_result(folder.parent))
    assert len(scene.solids) == 1
    blind = replace(scene, loose=np.zeros((0, 3)), hidden=NOTHING_HIDDEN)
    among, without = (
        plan_grasps(each, per_object=20, min_score=0.0)
        for each in (blind, replace(blind, solids=()))
    )
    assert swept(among, wall_mesh()) == 0 < swept(without, wall_mesh())


def test_nor_do_they_go_behind_it(folder):
    """By what it hides alone."""
    scene = replace(scene_of(open_result(folder.parent)), loose=np.zeros((0, 3)), solids=())
    seen, blind = (
        plan_grasps(each, per_object=20, min_score=0.0)
        for each in (scene, replace(scene, hidden=NOTHING_HIDDEN))
    )
    assert swept(seen, wall_mesh()) < swept(blind, wall_mesh())
