"""The tool on meshes from anywhere, and beside `brrp eval`."""

import csv
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import score_results
import trimesh
from click.testing import CliRunner
from tiny_scenes import MESHES, write_meshes, write_scene

from brrp_cli.cli import main
from brrp_cli.ground_truth.surface_metrics import SURFACE_METRICS

CAN, BALL = 9, 3


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("score")
    write_meshes(folder / "data" / "shapes")
    write_scene(folder / "scenes" / "a", {CAN: ("can", -0.1, 0.03), BALL: ("ball", 0.09, 0.0)})
    return folder


@pytest.fixture(scope="module")
def stranger(place):
    """What another program wrote: the true can in the world, and no ball."""
    folder = place / "stranger"
    folder.mkdir()
    can = MESHES["can"].copy().apply_translation([-0.1, 0.03, 0])
    can.export(folder / f"object_{CAN}.ply")
    return folder


def scored(place, results, *options):
    """Rows of the command, by id."""
    table = place / "scores.csv"
    command = [sys.executable, "tools/score_results.py", str(results), "-o", str(table)]
    command += ["--truth", str(place / "scenes" / "a" / "0000")]
    command += ["--data-root", str(place / "data"), *options]
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with table.open(newline="") as stream:
        return {int(row["object_id"]): row for row in csv.DictReader(stream)}, done.stdout


def test_a_strangers_meshes_are_scored(place, stranger):
    rows, said = scored(place, stranger, "--frame", "world")
    assert list(rows) == [BALL, CAN]
    can, ball = rows[CAN], rows[BALL]
    assert float(can["surface_distance"]) < 1e-6 and float(can["f_score_2mm"]) == 1.0
    assert float(can["volume_ratio"]) == pytest.approx(1.0, abs=1e-5)
    assert (can["name"], can["thickness_class"]) == ("can", "solid")
    assert ball["f_score_2mm"] == "0.0" and math.isnan(float(ball["surface_distance"]))
    assert "1 of 2 objects without a mesh" in said and "mean of 2" in said


def test_meshes_in_the_wrong_frame_score_nothing(place, stranger):
    rows, _ = scored(place, stranger)
    assert float(rows[CAN]["f_score_10mm"]) == 0.0
    assert float(rows[CAN]["surface_distance"]) > 0.1


def test_a_missing_truth_is_said(place, stranger):
    command = [sys.executable, score_results.__file__, str(stranger), "--data-root", str(place)]
    command += ["--truth", str(place / "nothing")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("Error: ")
    assert "Traceback" not in done.stderr


def test_vertices_that_every_face_has_of_its_own_are_one(tmp_path):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    soup = trimesh.Trimesh(
        box.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False
    )
    soup.export(tmp_path / "object_1.ply")
    assert score_results.read_mesh(tmp_path / "object_1.ply").is_volume


@pytest.mark.slow
def test_the_tool_and_eval_agree(place):
    """On the same reconstruction; what is written has single precision."""
    pytest.importorskip("point_cloud_utils")
    view = place / "scenes" / "a" / "0000"
    method = ["--method", "vprism"]
    wrote = CliRunner().invoke(
        main, ["-q", "reconstruct", str(view), *method, "-o", str(place / "out")]
    )
    assert wrote.exit_code == 0, wrote.output
    evaluated = CliRunner().invoke(
        main,
        ["-q", "eval", str(place / "scenes"), *method, "-o", str(place / "eval"), "--workers", "1"],
    )
    assert evaluated.exit_code == 0, evaluated.output
    with (place / "eval" / "metrics.csv").open(newline="") as stream:
        told = {int(row["object_id"]): row for row in csv.DictReader(stream)}
    rows, _ = scored(place, place / "out")
    for object_id, row in rows.items():
        assert row["thickness_class"] == told[object_id]["thickness_class"]
        for name in SURFACE_METRICS:
            expected = float(told[object_id][name])
            assert float(row[name]) == pytest.approx(expected, rel=2e-3, abs=2e-6), name
        assert 0.1 < float(row["f_score_5mm"]) < 1.0
