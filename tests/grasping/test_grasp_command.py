"""Results to grasps through the real command, and the arrays as their readers read them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from made_result import BOX, ELL, SPECK, truth, write_made_result
from table_scene import T_CAM_WORLD, T_WORLD_CAM, TABLE
from table_scene import in_camera as in_camera_frame

from brrp_cli import open_gripper, open_result, plan_grasps
from brrp_cli.cli import main
from brrp_cli.config.grasping import GraspConfig
from brrp_cli.geometry import transform_points
from brrp_cli.grasping.record import grasps_record
from brrp_cli.raycast import raycasting_scene

FRANKA = open_gripper("franka-hand")


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["grasp", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """In the world's frame, so that what is in which frame shows."""
    return write_made_result(tmp_path_factory.mktemp("made") / "out", frame="world")


@pytest.fixture(scope="module")
def planned(results) -> tuple[dict, str]:
    code, output = run(results)
    assert code == 0
    return json.loads((results / "grasps.json").read_text()), output


def of(record: dict, object_id: int) -> dict:
    return next(item for item in record["objects"] if item["id"] == object_id)


def in_camera(grasp: dict) -> np.ndarray:
    return np.linalg.inv(T_WORLD_CAM) @ np.array(grasp["T_world_gripper"])


def ranked(grasps):
    """By score, and a little by quality."""
    return sorted(grasps, key=lambda g: -g["score"] * g["quality"] ** GraspConfig.taste)


def test_each_object_has_grasps_or_a_reason(planned):
    record, output = planned
    assert [item["id"] for item in record["objects"]] == sorted([BOX, ELL, SPECK])
    assert of(record, SPECK)["grasps"] == []
    assert "4 valid depth points" in of(record, SPECK)["why_none"]
    assert f"object {SPECK}: no grasp, it has no mesh" in output
    for object_id in (BOX, ELL):
        item = of(record, object_id)
        assert item["grasps"] and item["why_none"] is None
        assert item["fell"]["points"] > item["fell"]["not_antipodal"]
        assert ranked(item["grasps"]) == item["grasps"]
        scores = [grasp["score"] for grasp in item["grasps"]]
        assert max(scores) > 0.7
        assert record["min_score"] <= min(scores) and max(scores) <= 1


def test_fingers_close_on_the_true_shape_and_come_in_past_it(planned):
    """The truth is a box of 9 x 6 x 12 cm: only its 6 cm fit a Franka Hand."""
    record, _ = planned
    box = truth()[BOX]
    scene = raycasting_scene([box])
    for grasp in of(record, BOX)["grasps"]:
        assert grasp["width"] == pytest.approx(0.06, abs=0.006)
        contacts = transform_points(np.linalg.inv(T_WORLD_CAM), np.array(grasp["contacts"]))
        assert scene.compute_distance(contacts.astype(np.float32)).numpy().max() < 0.004
        T = in_camera(grasp)
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
        tip = T @ [0, 0, FRANKA.tip, 1]
        assert TABLE.signed_distance(tip[None, :3])[0] > 0
    assert record["frame"] == "world" and record["config"]["friction"] == 0.5
    assert record["gripper"]["name"] == "Franka Hand"


def test_graspnet_reads_its_layout(results, tmp_path):
    """As GraspGroup does: np.load, rotation_matrix from columns 4 to 12, translation 13 to 15."""
    out = tmp_path / "mine.json"
    assert run(results, "--format", "graspnet", "-o", out)[0] == 0
    array = np.load(tmp_path / "mine.npy")
    record = json.loads(out.read_text())
    every = [(g, o["id"]) for o in record["objects"] for g in o["grasps"]]
    assert array.dtype == np.float32 and array.shape == (len(every), 17)
    best_first = [g["score"] for g in ranked([g for g, _ in every])]
    np.testing.assert_allclose(array[:, 0], best_first, atol=1e-6)
    for row in array:
        R, centre, depth = row[4:13].reshape(3, 3), row[13:16], row[3]
        ours = [in_camera(g) for g, i in every if i == int(row[16])]
        tips = np.array([T @ [0, 0, FRANKA.tip, 1] for T in ours])[:, :3]
        # Their fingertips lie `depth` beyond the centre along their x, the approach.
        nearest = np.linalg.norm(tips - (centre + depth * R[:, 0]), axis=1).argmin()
        # Their y closes the hand: our x.
        T = ours[nearest]
        np.testing.assert_allclose(R[:, 0], T[:3, 2], atol=1e-5)
        np.testing.assert_allclose(R[:, 1], T[:3, 0], atol=1e-5)
        assert np.linalg.det(R) == pytest.approx(1, abs=1e-4)
        assert 0 < depth < FRANKA.finger_length and 0 < row[1] <= FRANKA.opening


def test_contact_graspnet_reads_its_layout(results, tmp_path):
    """As its inference.py saves it: dictionaries by object id, in an .npz."""
    out = tmp_path / "mine.json"
    assert run(results, "--format", "contact-graspnet", "-o", out)[0] == 0
    data = np.load(tmp_path / "mine.npz", allow_pickle=True)
    assert set(data) == {"pred_grasps_cam", "scores", "contact_pts", "gripper_openings"}
    grasps, points = data["pred_grasps_cam"].item(), data["contact_pts"].item()
    scores, openings = data["scores"].item(), data["gripper_openings"].item()
    assert set(grasps) == {BOX, ELL}
    record = json.loads(out.read_text())
    for object_id, T in grasps.items():
        mine = of(record, object_id)["grasps"]
        np.testing.assert_allclose(T, [in_camera(g) for g in mine], atol=1e-6)
        np.testing.assert_allclose(scores[object_id], [g["score"] for g in mine], atol=1e-6)
        np.testing.assert_allclose(openings[object_id], [g["opening"] for g in mine], atol=1e-6)
        left = transform_points(T_WORLD_CAM, points[object_id])
        np.testing.assert_allclose(left, [g["contacts"][0] for g in mine], atol=1e-6)


def test_the_best_hands_are_a_scene_in_the_frame_of_the_results(results, planned):
    scene = trimesh.load_scene(results / "grasps.glb")
    assert set(scene.geometry) == {f"grasps_{BOX}", f"grasps_{ELL}"}
    hands = scene.geometry[f"grasps_{BOX}"]
    tips = [np.array(g["T_world_gripper"])[:3, 3] for g in of(planned[0], BOX)["grasps"][:5]]
    low, high = np.min(tips, axis=0), np.max(tips, axis=0)
    grown = hands.bounds + np.array([[-0.1], [0.1]])
    assert (grown[0] <= low).all() and (high <= grown[1]).all()
    # A score near 1 is green.
    colour = np.asarray(hands.visual.vertex_colors)[0]
    assert colour[1] > colour[0] and colour[1] > colour[2]


def test_python_plans_what_the_command_does(results, planned):
    plan = plan_grasps(open_result(results), "franka-hand")
    for each in plan.objects:
        mine = of(planned[0], each.object_id)["grasps"]
        ours = [grasp.T_cam_gripper for grasp in each.grasps]
        np.testing.assert_allclose(ours, [in_camera(g) for g in mine], atol=1e-9)
    assert plan.grasps[0].score == max(grasp.score for grasp in plan.grasps)
    camera = grasps_record(plan)
    assert camera["frame"] == "camera"
    first = next(item for item in camera["objects"] if item["grasps"])
    best = next(each for each in plan.objects if each.grasps).grasps[0]
    np.testing.assert_allclose(first["grasps"][0]["T_cam_gripper"], best.T_cam_gripper)


def test_options_decide(results, tmp_path):
    out = tmp_path / "g.json"
    code, output = run(
        results, "-o", out, "--gripper", "robotiq-2f-140", "--approach", "top-down",
        "--per-object", 3, "--min-score", 0.5, "--friction", 0.3, "--confidence", 0, "--json",
    )  # fmt: skip
    assert code == 0
    report = json.loads(output[output.index("{") :])
    record = json.loads(out.read_text())
    assert record["gripper"]["opening"] == 0.14 and record["config"]["friction"] == 0.3
    assert record["config"]["confidence"] == 0
    for item, told in zip(record["objects"], report["objects"], strict=True):
        assert len(item["grasps"]) == told["grasps"] <= 3
        for grasp in item["grasps"]:
            z = in_camera(grasp)[:3, 2]
            assert z @ -TABLE.normal > np.cos(np.deg2rad(15.1))
            assert grasp["score"] >= 0.5
    code, output = run(results, "-o", out)
    assert code == 1 and "--overwrite" in output


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("best.glb", (), "must end in .json, not 'best.glb'"),
        ("best.npy", ("--format", "graspnet"), "must end in .json"),
        ("folder/", (), "must end in .json"),
        ("result.json", (), "result.json is a file of `brrp reconstruct`"),
        ("scene.json", (), "scene.glb is a file"),
        ("frame.json", ("--format", "contact-graspnet"), "frame.npz is a file"),
    ],
)
def test_grasps_take_no_other_file_s_name(name, options, says, results):
    before = {path: path.stat().st_mtime_ns for path in results.iterdir()}
    code, output = run(results, "-o", f"{results}/{name}", "--overwrite", *options)
    assert code == 2 and says in output
    assert {path: path.stat().st_mtime_ns for path in results.iterdir()} == before


def test_a_hand_keeps_out_of_an_arm_on_demand_alone(tmp_path, planned):
    reach = trimesh.creation.cylinder(0.05, segment=[(-0.1, 0.05, 0.22), (0.0, 0.9, 0.35)])
    under = write_made_result(tmp_path / "under", unmasked=in_camera_frame(reach, T_CAM_WORLD))
    blocked = []
    for options in ((), ("--avoid-arms",)):
        code, _ = run(under, "-o", tmp_path / "g.json", "--overwrite", *options)
        assert code == 0
        record = json.loads((tmp_path / "g.json").read_text())
        assert record["config"]["surroundings"]["arms"] is bool(options)
        blocked.append(of(record, BOX)["fell"]["neighbour"])
    free = of(planned[0], BOX)["fell"]["neighbour"]
    assert abs(blocked[0] - free) < 0.05 * (blocked[1] - free)


def test_what_min_score_left_out_is_told_with_the_option_as_typed(results, planned, tmp_path):
    best = max(grasp["score"] for grasp in of(planned[0], ELL)["grasps"])
    assert best < 1
    code, output = run(results, "-o", tmp_path / "g.json", "--min-score", 1)
    assert code == 0
    item = of(json.loads((tmp_path / "g.json").read_text()), ELL)
    assert item["grasps"] == [] and "less than --min-score 1" in item["why_none"]
    assert f"object {ELL}: no grasp, its best grasp holds with probability 0." in output


def message(*arguments: object) -> str:
    code, output = run(*arguments)
    assert code == 1 and output.count("Error: ") == 1 and "Traceback" not in output
    return output


def test_bad_input_gets_one_message(results, tmp_path):
    assert "No such gripper" in message(tmp_path, "--gripper", "shadow-hand")
    assert "There are no results" in message(tmp_path / "none")
    folder = Path(shutil.copytree(results, tmp_path / "out"))
    path = folder / "result.json"
    record = json.loads(path.read_text())
    for item in record["objects"]:
        item["mesh"] = None
    path.write_text(json.dumps(record))
    told = message(folder)
    assert "nothing to grasp" in told and f"object {SPECK}: 4 valid" in told
    path.write_text(json.dumps({"schema": 0}))
    assert "another schema" in message(folder)
