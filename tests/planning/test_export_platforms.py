"""A platform on the table in what `brrp export` writes, and in what `brrp grasp` keeps out of."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from exported import exported, swept
from moveit_messages import read_scene

from brrp_cli.api import open_result
from brrp_cli.config.planning import TableBoxConfig
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.hidden_space import NOTHING_HIDDEN
from brrp_cli.grasping.plan import plan_grasps
from brrp_cli.grasping.scene import scene_of
from brrp_cli.planning.options import PlanOptions
from brrp_cli.planning.scene import planned_objects, table_under
from brrp_cli.segmentation.furniture import Furniture

SIZE = (0.5, 0.45, 0.015)


def platform_mesh() -> trimesh.Trimesh:
    """Things of the made result, which stand on the table, go through it."""
    return trimesh.creation.box(SIZE).apply_translation([0.0, 0.0, SIZE[2] / 2])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    pytest.importorskip("mujoco")
    return exported(tmp_path_factory.mktemp("made"), platform_mesh())


def is_it(corners: np.ndarray) -> bool:
    """Whether points (n, 3), world, are its corners, to a cell's width."""
    low, high = platform_mesh().bounds
    return bool(
        np.abs(corners.min(axis=0) - low).max() < 0.012
        and np.abs(corners.max(axis=0) - high).max() < 0.012
        and abs(corners[:, 2].max() - SIZE[2]) < 0.003
    )


def test_every_file_has_it(folder):
    record = json.loads((folder / "plan.json").read_text())
    (one,) = record["table"]["platforms"]
    assert one["name"] == "platform_1" and is_it(np.array(one["corners"]))
    _, objects = read_scene((folder / "moveit.scene").read_text())
    (shape,) = objects["platform_1"].shapes
    assert is_it(transform_points(objects["platform_1"].T, shape.vertices))
    stored = yaml.safe_load((folder / "world.yml").read_text())["mesh"]["platform_1"]
    assert is_it(np.array(stored["vertices"]))
    assert "platform_1" in trimesh.load_scene(folder / "scene.glb").geometry


def test_it_stands_on_the_table_and_cannot_move(folder):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    assert model.body_dofnum[model.geom_bodyid[model.geom("platform_1").id]] == 0
    table = json.loads((folder / "plan.json").read_text())["table"]
    top = table["T_frame_table"][2][3] + table["size"][2] / 2
    assert top == pytest.approx(0.0, abs=0.003)


def test_the_table_lies_beneath_where_the_plane_is_that_of_a_platform(folder):
    stored = open_result(folder.parent)
    bodies = [each.body for each in planned_objects(stored, PlanOptions(collision="hull"))]
    assert stored.plane is not None
    usual, low = (
        table_under(bodies, stored.plane, TableBoxConfig(), Furniture(beneath=b))
        for b in (0.0, 0.02)
    )
    assert usual.offset == pytest.approx(stored.plane.offset)
    assert low.offset == pytest.approx(stored.plane.offset + 0.02)


def test_hands_keep_out_of_it(folder):
    scene = scene_of(open_result(folder.parent))
    assert len(scene.solids) == 1
    scene = replace(scene, loose=np.zeros((0, 3)), hidden=NOTHING_HIDDEN)
    among, without = (
        plan_grasps(each, per_object=20, min_score=0.0)
        for each in (scene, replace(scene, solids=()))
    )
    # Its model may lie a little lower than its face.
    core = trimesh.creation.box((0.4, 0.4, 0.008)).apply_translation([0.0, 0.0, 0.005])
    assert swept(among, core) == 0 < swept(without, core)
