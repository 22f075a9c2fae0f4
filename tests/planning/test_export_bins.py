"""Bins in what `brrp export` writes, and in what `brrp grasp` keeps out of."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from exported import exported, swept
from made_result import BOX
from moveit_messages import message, read_scene

from brrp_cli.api import open_result
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.hidden_space import NOTHING_HIDDEN
from brrp_cli.grasping.plan import plan_grasps
from brrp_cli.grasping.scene import scene_of
from brrp_cli.shapes import solids

# Around the box and the L, without a floor: both stand on the table.
LENGTH, WIDTH, HEIGHT, THICK = 0.36, 0.19, 0.08, 0.005
MIDDLE = np.array([-0.005, 0.005, 0.0])


def bin_mesh() -> trimesh.Trimesh:
    outer = solids.box(LENGTH + 2 * THICK, WIDTH + 2 * THICK, HEIGHT)
    hollow = solids.moved(solids.box(LENGTH, WIDTH, HEIGHT + 0.02), z=-0.01)
    return solids.moved(solids.difference(outer, hollow), x=MIDDLE[0], y=MIDDLE[1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    pytest.importorskip("mujoco")
    return exported(tmp_path_factory.mktemp("made"), bin_mesh())


def on_the_walls(points: np.ndarray) -> bool:
    """Whether points (n, 3), world, lie on the true walls to a centimetre, and on all of them."""
    middle = points - MIDDLE
    beyond = np.abs(middle[:, :2]) - np.array([LENGTH, WIDTH]) / 2
    on = np.abs(beyond) < 0.01
    sides = [(on[:, axis] & (s * middle[:, axis] > 0)).any() for axis in (0, 1) for s in (-1, 1)]
    return (
        all(sides)
        and float(np.abs(beyond.max(axis=1)).max()) < 0.012
        and abs(points[:, 2].max() - HEIGHT) < 0.008
        and abs(points[:, 2].min()) < 0.004
    )


def test_the_record_and_moveit_have_its_walls(folder):
    record = json.loads((folder / "plan.json").read_text())
    (one,) = record["table"]["bins"]
    assert one["name"] == "bin_1" and np.shape(one["walls"]) == (4, 8, 3)
    assert on_the_walls(np.reshape(one["walls"], (-1, 3)))
    _, objects = read_scene((folder / "moveit.scene").read_text())
    item = objects["bin_1"]
    assert len(item.shapes) == 4 and not item.subframes
    shown = np.vstack([transform_points(item.T, shape.vertices) for shape in item.shapes])
    assert on_the_walls(shown)
    scene = json.loads((folder / "moveit.json").read_text())
    message("moveit_msgs/msg/PlanningScene", scene)
    sent = next(each for each in scene["world"]["collision_objects"] if each["id"] == "bin_1")
    assert len(sent["meshes"]) == len(sent["mesh_poses"]) == 4


def test_curobo_and_the_picture_have_them(folder):
    world = yaml.safe_load((folder / "world.yml").read_text())
    stored = world["mesh"]["bin_1"]
    mesh = trimesh.Trimesh(stored["vertices"], stored["faces"], process=False)
    assert mesh.is_watertight and on_the_walls(mesh.vertices)
    scene = trimesh.load_scene(folder / "scene.glb")
    assert {f"bin_1_wall_{i}" for i in range(4)} <= set(scene.geometry)


def test_in_the_simulator_they_stand_still_and_hold_what_is_pushed(folder):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    walls = [model.geom(f"bin_1_wall_{i}").id for i in range(4)]
    where = data.geom_xpos[walls].copy()
    push = np.array([-8.0, 0.0, 0.0])
    body = data.body(f"object_{BOX}")
    for _ in range(1500):
        body.xfrc_applied[:3] = push
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.geom_xpos[walls], where)
    # Half its diagonal at most from the inner face of the wall, and not through it.
    inner = MIDDLE[0] - LENGTH / 2
    assert inner < body.xpos[0] < inner + 0.06


def test_hands_keep_out_of_walls_that_nothing_shows(folder):
    scene = scene_of(open_result(folder.parent))
    scene = replace(scene, loose=np.zeros((0, 3)), hidden=NOTHING_HIDDEN)
    among, without = (
        plan_grasps(each, per_object=20, min_score=0.0)
        for each in (scene, replace(scene, solids=()))
    )
    assert len(scene.solids) == 4
    assert {item.object_id for item in among.objects if item.grasps} >= {BOX}
    assert swept(among, bin_mesh()) == 0 < swept(without, bin_mesh())
