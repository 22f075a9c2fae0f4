"""Results to collision shapes through the real command, and into the simulators."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from click.testing import CliRunner
from drop import drop_in_mujoco, drop_in_pybullet, settle_scene
from made_result import BOX, ELL, HOLLOW, SPECK, solid_box, truth, write_made_result
from table_scene import NORMAL, T_CAM_WORLD, T_WORLD_CAM, TABLE

from brrp_cli.api import open_result
from brrp_cli.cli import main
from brrp_cli.geometry import transform_points
from brrp_cli.planning.parts import beyond_hull

DENSITY = 400.0


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["export", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    return write_made_result(tmp_path_factory.mktemp("made") / "out")


@pytest.fixture(scope="module")
def plan(results) -> tuple[Path, str]:
    pytest.importorskip("coacd")
    code, output = run(results, "--density", DENSITY)
    assert code == 0
    return results / "plan", output


@pytest.fixture(scope="module")
def grown(results) -> Path:
    folder = results.parent / "grown"
    assert run(results, "--collision", "hull", "--confidence", 0.95, "-o", folder)[0] == 0
    return folder


@pytest.fixture(scope="module")
def tight(results) -> Path:
    """Results of a configuration that gives guesses no room."""
    folder = results.parent / "tight"
    shutil.copytree(results, folder, ignore=shutil.ignore_patterns("plan"))
    told = json.loads((folder / "result.json").read_text())
    told["config"]["surface"] |= {"around_seen": 1e-9, "around_most": 1e-9}
    (folder / "result.json").write_text(json.dumps(told))
    assert run(folder, "--collision", "hull", "--confidence", 0.95)[0] == 0
    return folder


def record(folder: Path) -> dict:
    return json.loads((folder / "plan.json").read_text())


def of(folder: Path, object_id: int) -> dict:
    return next(item for item in record(folder)["objects"] if item["id"] == object_id)


def parts(folder: Path, object_id: int) -> list[np.ndarray]:
    """Corners (k, 3) of each part, in the frame of the results."""
    item = of(folder, object_id)
    T = np.array(item["T_frame_body"])
    return [
        transform_points(T, np.asarray(trimesh.load_mesh(folder / name).vertices))
        for name in item["parts"]
    ]


def lowest(folder: Path, object_id: int) -> float:
    item = of(folder, object_id)
    return min(trimesh.load_mesh(folder / name).bounds[0, 2] for name in item["parts"])


def test_says_what_it_wrote_and_what_it_left_out(plan):
    folder, output = plan
    assert {p.name for p in folder.iterdir()} == {
        "meshes", "plan.json", "scene.glb", "scene.xml", "world.yml",
        "object_7.urdf", "object_7.xml", "object_-3.urdf", "object_-3.xml",
    }  # fmt: skip
    assert "of 2 objects, metres, camera frame" in output
    assert f"object {SPECK}: left out, 4 valid depth points" in output
    assert [item["id"] for item in record(folder)["left_out"]] == [SPECK]


def test_bodies_stand_upright_at_their_centres_of_mass(plan):
    for object_id, true in truth().items():
        T = np.array(of(plan[0], object_id)["T_frame_body"])
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(T[:3, 2], NORMAL, atol=1e-6)
        np.testing.assert_allclose(T[:3, 3], true.center_mass, atol=0.003)


def test_mass_and_inertia_are_those_of_the_solid_at_the_density(plan):
    item = of(plan[0], BOX)
    mass = DENSITY * solid_box().volume
    assert item["mass"] == pytest.approx(mass, rel=0.08)
    # A box about its centre: the moment about its upright axis depends on no turn about it.
    moment = mass * (0.09**2 + 0.06**2) / 12
    assert item["inertia"][2][2] == pytest.approx(moment, rel=0.15)
    np.testing.assert_allclose(item["inertia"], np.transpose(item["inertia"]))


def test_parts_hold_the_mesh_and_keep_what_is_hollow(plan):
    for object_id in (BOX, ELL):
        mesh = trimesh.load_mesh(plan[0].parent / f"object_{object_id}.ply", process=False)
        outside = np.min([beyond_hull(p, mesh.vertices) for p in parts(plan[0], object_id)], 0)
        assert outside.max() < 1e-5
    hollow = T_CAM_WORLD @ [*HOLLOW, 1]
    assert min(beyond_hull(p, hollow[None, :3])[0] for p in parts(plan[0], ELL)) > 0.01


def test_the_hull_fills_it(grown):
    hollow = T_CAM_WORLD @ [*HOLLOW, 1]
    (hull,) = parts(grown, ELL)
    assert beyond_hull(hull, hollow[None, :3])[0] < 0


def test_a_margin_holds_the_true_surface_and_follows_the_uncertainty(tight):
    """The posterior's surface is logistic with scale 2 mm: at 0.95 it is grown by 2 ln 19 mm."""
    for object_id, true in truth().items():
        (hull,) = parts(tight / "plan", object_id)
        assert beyond_hull(hull, true.vertices).max() < 0
        item = of(tight / "plan", object_id)
        assert item["level"] == pytest.approx(0.05, rel=0.1)
        assert item["bounded"]
        assert item["margin_mean"] == pytest.approx(0.0059, abs=0.001)


def test_what_is_guessed_is_held_with_room_where_nothing_was_seen(results, grown):
    """The posterior's surface is logistic with scale 2 mm: at 0.95 C_t lies 2 ln 19 mm beyond it,
    and the shape 1 to 5 cm beyond that."""
    frame = open_result(results).frame
    for object_id, true in truth().items():
        (hull,) = parts(grown, object_id)
        assert beyond_hull(hull, true.vertices).max() < 0
        item = of(grown, object_id)
        assert item["level"] == pytest.approx(0.05, rel=0.1)
        assert item["bounded"]
        assert 0.0059 < item["margin_mean"] < item["margin_max"] < 0.0059 + 0.05 + 0.005
        mesh = trimesh.load_mesh(results / f"object_{object_id}.ply", process=False)
        region = trimesh.load_mesh(
            grown / "meshes" / f"object_{object_id}_inside.obj", process=False
        )
        assert region.is_watertight and region.volume > mesh.volume
        # Towards the camera it is as good as seen.
        corners = transform_points(np.array(item["T_frame_body"]), np.asarray(region.vertices))
        seen = frame.object_points(object_id)
        assert corners[:, 2].min() > seen[:, 2].min() - 0.0059 - 0.01 - 0.005
    assert record(grown)["confidence"] == 0.95


def test_more_margin_holds_more_but_nothing_below_the_table(results, grown, tight, tmp_path):
    options = ("--collision", "hull", "--confidence", 0.95, "--margin", 20)
    assert run(results, *options, "-o", tmp_path / "plan")[0] == 0
    for object_id in (BOX, ELL):
        wide, narrow = of(tmp_path / "plan", object_id), of(grown, object_id)
        assert wide["collision_volume_litre"] > narrow["collision_volume_litre"]
        (hull,) = parts(tmp_path / "plan", object_id)
        assert TABLE.signed_distance(hull).min() > -0.012
    assert run(tight, *options, "-o", tmp_path / "tight")[0] == 0
    for object_id in (BOX, ELL):
        wide, narrow = of(tmp_path / "tight", object_id), of(tight / "plan", object_id)
        assert wide["collision_volume_litre"] > 1.1 * narrow["collision_volume_litre"]
        (hull,) = parts(tmp_path / "tight", object_id)
        assert TABLE.signed_distance(hull).min() > -0.012


@pytest.mark.parametrize("object_id", [BOX, ELL])
def test_dropped_in_pybullet_it_rests(plan, object_id):
    pytest.importorskip("pybullet")
    low = lowest(plan[0], object_id)
    found = drop_in_pybullet(plan[0] / f"object_{object_id}.urdf", low)
    assert found.mass == pytest.approx(of(plan[0], object_id)["mass"], rel=1e-6)
    assert found.crept < 0.001 and found.turned < 3 and found.shifted < 0.005
    assert found.height == pytest.approx(-low, abs=0.003)


@pytest.mark.parametrize("object_id", [BOX, ELL])
def test_dropped_in_mujoco_it_rests(plan, object_id):
    pytest.importorskip("mujoco")
    low = lowest(plan[0], object_id)
    found = drop_in_mujoco(plan[0] / f"object_{object_id}.xml", low)
    assert found.mass == pytest.approx(of(plan[0], object_id)["mass"], rel=1e-6)
    # Where it goes and not how fast: a round foot of many small parts chatters in place.
    assert found.crept < 0.001 and found.turned < 3 and found.shifted < 0.005
    assert found.height == pytest.approx(-low, abs=0.003)


def test_the_whole_scene_rests_on_its_table(plan, tight):
    pytest.importorskip("mujoco")
    for folder in (plan[0], tight / "plan"):
        for moved, lately in settle_scene(folder / "scene.xml").values():
            assert moved < 0.003 and lately < 0.001


def test_curobo_reads_poses_and_closed_meshes(plan):
    """As `WorldConfig.from_dict` does: keyword arguments of Cuboid and Mesh; quaternions wxyz."""
    world = yaml.safe_load((plan[0] / "world.yml").read_text())
    assert set(world) == {"cuboid", "mesh"}
    table = world["cuboid"]["table"]
    top = trimesh.transformations.quaternion_matrix(table["pose"][3:])[:3, 2]
    np.testing.assert_allclose(top, NORMAL, atol=1e-5)
    on_top = np.array(table["pose"][:3]) + top * table["dims"][2] / 2
    assert TABLE.signed_distance(on_top) == pytest.approx(0, abs=1e-5)
    for object_id in (BOX, ELL):
        stored = world["mesh"][f"object_{object_id}"]
        assert set(stored) == {"pose", "color", "vertices", "faces"}
        mesh = trimesh.Trimesh(stored["vertices"], stored["faces"], process=False)
        assert mesh.is_watertight and mesh.volume > 0
        T = trimesh.transformations.quaternion_matrix(stored["pose"][3:])
        T[:3, 3] = stored["pose"][:3]
        np.testing.assert_allclose(T, of(plan[0], object_id)["T_frame_body"], atol=1e-5)
        held = np.vstack(parts(plan[0], object_id))
        np.testing.assert_allclose(
            transform_points(T, mesh.vertices).max(axis=0), held.max(axis=0), atol=1e-4
        )


def test_one_glb_has_every_part_and_the_table(plan):
    scene = trimesh.load_scene(plan[0] / "scene.glb")
    count = sum(len(of(plan[0], i)["parts"]) for i in (BOX, ELL))
    assert len(scene.geometry) == count + 1
    corners = np.vstack([p for i in (BOX, ELL) for p in parts(plan[0], i)])
    names = [n for n in scene.graph.nodes_geometry if n.startswith("object_")]
    shown = np.vstack([
        transform_points(scene.graph[n][0], scene.geometry[scene.graph[n][1]].vertices)
        for n in names
    ])  # fmt: skip
    np.testing.assert_allclose(shown.min(axis=0), corners.min(axis=0), atol=1e-5)


def test_the_world_frame_is_that_of_the_results(tmp_path):
    folder = write_made_result(tmp_path / "out", frame="world")
    code, output = run(folder, "--collision", "hull", "--confidence", 0.9)
    assert code == 0 and "world frame" in output
    item = of(folder / "plan", BOX)
    np.testing.assert_allclose(np.array(item["T_frame_body"])[:3, 2], [0, 0, 1], atol=1e-6)
    true = transform_points(T_WORLD_CAM, truth()[BOX].vertices)
    (hull,) = parts(folder / "plan", BOX)
    assert beyond_hull(hull, true).max() < 0
    assert record(folder / "plan")["up"] == pytest.approx([0, 0, 1], abs=1e-6)


def test_the_same_again_gives_the_same_bytes(results, grown, tmp_path):
    options = ("--collision", "hull", "--confidence", 0.95)
    assert run(results, *options, "-o", tmp_path / "again")[0] == 0
    for path in grown.rglob("*"):
        if path.is_file():
            again = tmp_path / "again" / path.relative_to(grown)
            assert again.read_bytes() == path.read_bytes(), path


def test_refuses_what_it_cannot_do(results, tmp_path):
    code, output = run(tmp_path / "nothing")
    assert code == 1 and "There are no results" in output
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    code, output = run(results, "--collision", "hull", "--overwrite", "-o", tmp_path / "mine")
    assert code == 1 and "other things" in output
    assert run(results, "--confidence", 0.2)[0] == 2
    assert run(results, "--density", 0)[0] == 2
    code, output = run(results, "--margin", 10)
    assert code == 2 and "--confidence" in output
    held = ("--confidence", 0.95, "--collision", "hull", "-o", tmp_path / "held")
    code, output = run(results, *held, "--rest")
    assert code == 2 and "--rest and --confidence exclude each other" in output
    assert not (tmp_path / "held").exists()
    assert run(results, *held, "--no-rest")[0] == 0


def test_without_coacd_it_says_what_to_install(results, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "coacd", None)
    code, output = run(results, "-o", tmp_path / "plan")
    assert code == 1 and "pip install coacd" in output and "Traceback" not in output
    assert "--collision hull" in output
    assert not (tmp_path / "plan").exists()
