"""PointSDF through the real commands, with weights that learnt eight objects."""

import csv
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from eight_objects import MESHES

from brrp_cli import load_frame, reconstruct
from brrp_cli.cli import main
from brrp_cli.errors import BrrpError, WeightsError
from brrp_cli.evaluation.variants import expand
from brrp_cli.frames.npz import save_frame
from brrp_cli.methods.pointsdf.weights import load_weights, save_weights
from brrp_cli.methods.registry import METHODS

TWO = [4, 8]
BOX = [4]


def run(*arguments):
    result = CliRunner().invoke(main, [*map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def out(trained, tmp_path_factory):
    folder = tmp_path_factory.mktemp("reconstruct") / "out"
    options = ("--method", "pointsdf", "--weights", trained.weights, "-o", folder)
    return folder, run("reconstruct", trained.folder / "scenes" / "0.npz", *options)


def test_reconstruct_writes_what_the_other_methods_write(out):
    folder, result = out
    assert result.exit_code == 0, result.output
    assert "8 of 8" in result.output and "without a prior" in result.output
    names = {path.name for path in folder.iterdir()}
    assert {"scene.glb", "posterior.h5", "result.json", "preview.png"} < names
    for i in range(len(MESHES)):
        mesh = trimesh.load(folder / f"object_{i + 1}.ply")
        assert mesh.is_watertight and mesh.volume > 0


@pytest.mark.slow
def test_meshes_have_the_volume_of_what_was_learnt_by_heart(learnt, tmp_path):
    options = ("--method", "pointsdf", "--weights", learnt.weights, "-o", tmp_path / "out")
    result = run("reconstruct", learnt.folder / "scenes" / "0.npz", *options)
    assert result.exit_code == 0, result.output
    for i, name in enumerate(MESHES):
        mesh = trimesh.load(tmp_path / "out" / f"object_{i + 1}.ply")
        # Grown by the level: occupancy is 0.3 a little outside of where it is 0.5.
        assert 0.6 < mesh.volume / MESHES[name].volume < 1.7, name


def test_the_record_says_what_was_trained(out, trained):
    record = json.loads((out[0] / "result.json").read_text())
    assert record["method"] == "pointsdf" and record["prior"] is None
    assert record["config"]["surface"]["level"] == 0.3
    weights = record["config"]["weights"]
    assert weights["training"]["name"] == "eight" and len(weights["sha256"]) == 64
    assert record["objects"][0]["uncertainty_unit"] == "metre"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--weights", "w.safetensors"], "means nothing to --method brrp"),
        (["--method", "pointsdf", "--weights", "none.safetensors"], "no weights there"),
        (["--method", "pointsdf", "--weights", "W", "--k", "3"], "leave out --k"),
    ],
)
def test_what_does_not_fit_is_refused_before_the_work(trained, tmp_path, options, said):
    options = [trained.weights if option == "W" else option for option in options]
    frame = trained.folder / "scenes" / "0.npz"
    result = run("reconstruct", frame, "-o", tmp_path / "out", *options)
    assert result.exit_code in (1, 2) and said in result.output
    assert "Traceback" not in result.output and not (tmp_path / "out").exists()


def test_python_refuses_what_does_not_fit(trained):
    frame = load_frame(trained.folder / "scenes" / "0.npz")
    with pytest.raises(BrrpError, match="vprism was not trained"):
        reconstruct(frame, method="vprism", weights=trained.weights)


def test_a_trained_method_that_brings_no_weights_needs_some(trained, monkeypatch):
    monkeypatch.setitem(METHODS, "pointsdf", replace(METHODS["pointsdf"], own_weights=None))
    frame = load_frame(trained.folder / "scenes" / "0.npz")
    with pytest.raises(WeightsError, match="needs trained weights"):
        reconstruct(frame, method="pointsdf")
    assert [each.weights for each in expand(["pointsdf"], [], [], [], [0])] == [None]


def write_some(trained, folder, ids):
    """The first scene with some of its objects alone."""
    scene = trained.scenes[0]
    frame = scene.view(0)
    folder.mkdir()
    masks = np.where(np.isin(frame.segmap, ids), frame.segmap, 0)
    save_frame(replace(frame, segmap=masks), folder / "0.npz")
    truth = json.loads((trained.folder / "scenes" / "0.truth.json").read_text())
    kept = [entry for entry in truth if entry["id"] in ids]
    (folder / "0.truth.json").write_text(json.dumps(kept))


@pytest.fixture(scope="module")
def report(learnt, tmp_path_factory):
    """Two trainings side by side: the same weights by two names."""
    folder = tmp_path_factory.mktemp("report")
    write_some(learnt, folder / "scenes", TWO)
    shutil.copy(learnt.weights, folder / "twin.safetensors")
    weights = f"{learnt.weights},{folder / 'twin.safetensors'}"
    chosen = ["--method", "pointsdf", "--weights", weights, "--shift-masks", "0,2"]
    command = ["eval", folder / "scenes", *chosen]
    where = ["--data-root", learnt.folder, "-o", folder / "out", "--workers", "1"]
    return folder / "out", run(*command, *where), [*command, *where]


@pytest.mark.slow
def test_two_trainings_stand_side_by_side(report):
    folder, result, _ = report
    assert result.exit_code == 0, result.output
    with (folder / "metrics.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["weights"] for row in rows} == {"eight", "twin"} and len(rows) == 2 * 4
    figures = {
        (name, shift): [
            (row["object_id"], row["iou"], row["chamfer"])
            for row in rows
            if (row["weights"], row["shift"]) == (name, shift)
        ]
        for name in ("eight", "twin")
        for shift in ("0", "2")
    }
    assert figures["eight", "0"] == figures["twin", "0"] != figures["eight", "2"]
    text = (folder / "report.md").read_text()
    assert "pointsdf eight shift 0" in text and "weights `twin`" in text
    assert (folder / "plots" / "iou_shift.png").exists()


@pytest.mark.slow
def test_the_level_is_what_counts_in_the_report(report):
    """At 0.3, as published: exact IoU is that of a network which learnt the objects by heart."""
    summary = json.loads((report[0] / "summary.json").read_text())
    assert summary["results"]["pointsdf eight shift 0"]["metrics"]["iou_exact"]["value"] > 0.75
    assert summary["trained"]["eight"]["name"] == "eight"


@pytest.mark.slow
def test_a_report_goes_on_and_other_weights_are_another_run(report, learnt, tmp_path):
    folder, _, command = report
    before = (folder / "rows.jsonl").read_bytes()
    assert run(*command).exit_code == 0
    assert (folder / "rows.jsonl").read_bytes() == before
    other = tmp_path / "twin.safetensors"
    save_weights(load_weights(learnt.weights).network, {"name": "twin"}, other)
    changed = [str(c).replace(str(folder.parent / "twin.safetensors"), str(other)) for c in command]
    result = run(*changed)
    assert result.exit_code == 1 and "weights" in result.output and "--overwrite" in result.output


def test_two_weights_of_one_name_are_refused(trained, tmp_path):
    twin = tmp_path / "eight.safetensors"
    shutil.copy(trained.weights, twin)
    command = ["eval", trained.folder / "scenes", "--method", "pointsdf", "-o", tmp_path / "out"]
    result = run(*command, "--weights", trained.weights, "--weights", twin)
    assert result.exit_code == 1 and "one name" in result.output


def test_an_evaluation_without_weights_takes_the_methods_own(trained, tmp_path):
    write_some(trained, tmp_path / "scenes", BOX)
    # The network that is shipped takes its time: fewer points are asked of it.
    few = 'method = "pointsdf"\nhalf_width = 0.12\n[surface]\nspacing = 0.02\nnodes = 8000\n'
    (tmp_path / "few.toml").write_text(few)
    command = ["eval", tmp_path / "scenes", "--data-root", trained.folder, "--method", "pointsdf"]
    options = ["--config", tmp_path / "few.toml", "--workers", "1"]
    result = run(*command, *options, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    with (tmp_path / "out" / "metrics.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["status"], row["weights"]) for row in rows] == [("ok", "tabletop")]
    told = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert told["trained"]["tabletop"]["scenes"] == 300
