import csv
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from tiny_scenes import write_meshes, write_scene

import brrp_cli
from brrp_cli.cli import main
from brrp_cli.evaluation.rows import COLUMNS, COST, RowLog, finished
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters

GHOST = 7


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with scenes, their meshes, a prior, and a cache of its own."""
    folder = tmp_path_factory.mktemp("eval")
    meshes = write_meshes(folder / "data" / "shapes")
    write_scene(folder / "scenes" / "a", {9: ("can", 0.02, 0.03)})
    write_scene(folder / "scenes" / "b", {2: ("ball", 0.0, 0.0)}, yaw=2.0, ghost=GHOST)
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(
        samples=1000, surface_points=500, dense_points=3000, appearance=looks
    )
    build_prior(meshes, folder / "prior", parameters, workers=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        patch.delenv("BRRP_CLIP_DIR", raising=False)
        yield folder


def run(place, *options):
    return CliRunner().invoke(main, ["-q", "eval", str(place / "scenes"), *map(str, options)])


def compare(place, output, *options):
    """Both methods, both presets, with the true object retrieved."""
    methods = ["--method", "brrp,vprism", "--preset", "paper,default", "--k", "1"]
    chosen = [*methods, "--retriever", "truth", "--prior", place / "prior", "-o", output]
    return run(place, *chosen, *options)


@pytest.fixture(scope="module")
def first(place):
    """The report's folder, and what the command said."""
    result = compare(place, place / "first", "--workers", "2", "--pictures")
    return place / "first", result


def rows_of(folder):
    with (folder / "metrics.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def without_cost(rows):
    return [{k: v for k, v in row.items() if k not in COST} for row in rows]


def test_each_object_has_a_row_for_each_variant(first):
    rows = rows_of(first[0])
    assert list(rows[0]) == list(COLUMNS)
    found = [(r["scene"], int(r["object_id"]), r["name"], r["method"], r["preset"]) for r in rows]
    names = [("a", 9, "can"), ("b", 2, "ball"), ("b", GHOST, "ball")]
    variants = [("brrp", "paper"), ("brrp", "default"), ("vprism", "")]
    assert found == [(*name, *variant) for name in names for variant in variants]


def test_shapes_are_measured(first):
    rows = [row for row in rows_of(first[0]) if int(row["object_id"]) != GHOST]
    for row in rows:
        assert row["status"] == "ok"
        # Solid objects of a hand's size, seen without noise: any broken frame or unit gives 0.
        assert float(row["iou"]) > 0.4 and float(row["iou_5mm"]) > 0.4
        assert 0 < float(row["chamfer"]) < 0.06
        assert float(row["f_score_1cm"]) > 0.4
        # The written mesh: every one of these is a ball, a can or a box, in one closed piece.
        assert 0 < float(row["surface_distance"]) < 0.02 and float(row["f_score_10mm"]) > 0.4
        assert 0.4 < float(row["volume_ratio"]) < 2.5 and row["thickness_class"] == "solid"
        assert row["watertight"] == row["one_piece"] == row["pieces"] == "1.0"
        assert float(row["surface_distance_seen"]) < 0.01
        for region in ("near", "occluded"):
            assert 0 < float(row[f"brier_{region}"]) < 0.25
            assert 0 < float(row[f"nll_{region}"]) < math.log(2)
        assert float(row["seconds_total"]) > 0 and float(row["peak_memory_mb"]) > 50
    for row in rows:
        if row["method"] == "brrp":
            assert (row["in_prior"], row["true_rank"], row["true_probability"]) == (
                "True",
                "1",
                "0.7",
            )
            assert row["best"] == row["name"] and float(row["placement_error"]) < 0.02
            if row["preset"] == "default":
                assert (row["recognised"], row["taken_for"]) == ("True", row["name"])
                assert float(row["weight_true"]) == float(row["weight_best"]) > 0.5
                assert float(row["size_factor"]) == pytest.approx(1.0, abs=0.11)
        else:
            assert row["best"] == row["true_rank"] == row["placement_error"] == ""


def test_what_failed_is_a_row_and_is_counted(first):
    folder, result = first
    ghosts = [row for row in rows_of(folder) if int(row["object_id"]) == GHOST]
    assert [row["status"] for row in ghosts] == ["too_few_points"] * 3
    assert all(row["iou"] == row["chamfer"] == "" for row in ghosts)
    # Without a mesh nothing of it is right, and there is no distance.
    assert all(row["f_score_10mm"] == row["watertight"] == "0.0" for row in ghosts)
    assert all(row["surface_distance"] == "" for row in ghosts)
    assert result.exit_code == 3, result.output
    assert "3 objects, 1 failed, 0 empty" in result.output
    summary = json.loads((folder / "summary.json").read_text())
    for found in summary["results"].values():
        assert (found["objects"], found["failed"]) == (3, 1)
        assert found["metrics"]["iou"]["count"] == 2
        written = found["written"]["all"]
        assert (written["objects"], written["without_mesh"]) == (3, 1)
        assert written["metrics"]["f_score_10mm"]["count"] == 3
        assert written["metrics"]["surface_distance_median"]["count"] == 2


def test_the_summary_holds_means_of_the_rows(first):
    folder, _ = first
    summary = json.loads((folder / "summary.json").read_text())
    assert list(summary["results"]) == ["brrp paper", "brrp default", "vprism"]
    rows = [row for row in rows_of(folder) if row["method"] == "vprism" and row["iou"]]
    found = summary["results"]["vprism"]["metrics"]
    for name in ("iou", "chamfer", "nll_occluded"):
        assert found[name]["value"] == pytest.approx(np.mean([float(r[name]) for r in rows]))
        assert found[name]["low"] <= found[name]["value"] <= found[name]["high"]
    both = summary["differences"]["brrp default - vprism"]["iou"]
    mine = [float(r["iou"]) for r in rows_of(folder) if r["preset"] == "default" and r["iou"]]
    assert both["count"] == 2
    assert both["value"] == pytest.approx(np.mean(mine) - found["iou"]["value"])


def test_report_plots_and_pictures_are_written(first):
    folder, _ = first
    text = (folder / "report.md").read_text()
    assert "| BRRP | 0.3124 | 0.5277 | 1.01 | 1.05 | 1.7 |" in text
    headings = [line for line in text.splitlines() if line.startswith("## ")]
    assert headings[0] == "## The written mesh against the exact mesh"
    for name in ("distance", "chamfer", "timing", "reliability"):
        assert f"![{name}](plots/{name}.png)" in text
        with Image.open(folder / "plots" / f"{name}.png") as image:
            assert image.size[0] > 400
    pictures = sorted(path.name for path in (folder / "pictures").iterdir())
    assert "a_brrp_paper_k1_truth.png" in pictures and "b_vprism.png" in pictures


@pytest.mark.slow
def test_a_killed_run_goes_on_and_gives_the_same_numbers(place, first):
    folder, _ = first
    again = place / "killed"
    again.mkdir()
    shutil.copy(folder / "run.json", again)
    text = (folder / "rows.jsonl").read_bytes()
    lines = text.splitlines(keepends=True)
    # The kill came in the middle of the last view's last row: that view is to be run again.
    (again / "rows.jsonl").write_bytes(text[: -len(lines[-1]) // 2])
    result = compare(place, again, "--workers", "1")
    assert result.exit_code == 3, result.output
    rows, before = rows_of(again), rows_of(folder)
    assert without_cost(rows) == without_cost(before)
    last = json.loads(lines[-1])
    kept = [r for r in before if (r["scene"], r["method"]) != (last["scene"], last["method"])]
    assert kept and all(row in rows for row in kept)


def test_another_run_in_the_folder_is_refused(place, first):
    folder, _ = first
    before = (folder / "metrics.csv").read_bytes()
    result = compare(place, folder, "--seed", "1")
    assert result.exit_code == 1
    assert "other parameters" in result.output and "seed: 0 -> 1" in result.output
    assert (folder / "metrics.csv").read_bytes() == before
    (place / "mine").mkdir()
    (place / "mine" / "thesis.txt").write_text("do not touch")
    result = run(place, "--method", "vprism", "-o", place / "mine")
    assert result.exit_code == 1 and "thesis.txt" in result.output


@pytest.mark.slow
def test_bare_the_report_lies_beside_the_scenes_and_shifts_are_compared(place):
    result = run(place, "--method", "vprism", "--shift-masks", "0,2", "--noise", "--scenes", "0:1")
    assert result.exit_code == 0, result.output
    folder = place / "scenes_eval"
    rows = rows_of(folder)
    assert [(r["object_id"], r["shift"]) for r in rows] == [("9", "0"), ("9", "2")]
    assert rows[0]["iou"] != rows[1]["iou"]
    assert (folder / "plots" / "iou_shift.png").is_file()


def retrieve(place, output, *options):
    """Retrieval alone, by appearance and by chance."""
    chosen = ["--method", "retrieval", "--retriever", "appearance,uniform"]
    return run(place, *chosen, "--prior", place / "prior", "-o", output, *options)


def test_a_cluster_gives_the_same_rows(place, monkeypatch):
    monkeypatch.chdir(place)
    assert retrieve(place, "by_processes", "--workers", "2").exit_code == 0
    result = retrieve(place, "by_dask", "--scheduler", "local:2")
    assert result.exit_code == 0, result.output
    rows = without_cost(rows_of(place / "by_dask"))
    assert len(rows) == 6
    assert rows == without_cost(rows_of(place / "by_processes"))
    names = [
        {path.name for path in (place / each).iterdir()} for each in ("by_dask", "by_processes")
    ]
    assert names[0] == names[1]


def test_retrieval_alone_is_measured(place):
    result = retrieve(place, place / "retrieval", "--workers", "1")
    assert result.exit_code == 0, result.output
    assert "retrieval appearance" in result.output and "among 3 1.000" in result.output
    rows = rows_of(place / "retrieval")
    assert len(rows) == 6
    for row in rows:
        assert row["status"] == "ok" and row["iou"] == ""
        if row["retriever"] == "uniform":
            assert float(row["not_in_prior"]) == 0
        elif int(row["object_id"]) != GHOST:
            assert row["best"] == row["name"] and row["true_rank"] == "1"
            assert 0 < float(row["not_in_prior"]) < 0.5
    report = (place / "retrieval" / "report.md").read_text()
    assert "by visible pixels" in report
    summary = json.loads((place / "retrieval" / "summary.json").read_text())
    hits = summary["results"]["retrieval appearance"]["hits"]
    assert hits[-1]["above"] == 0 and hits[-1]["most"] is None and hits[-1]["count"] == 3


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--data-root", "/nowhere"), "No such data folder"),
        (("--method", "magic"), "magic"),
        (("--retriever", "clip", "--method", "brrp", "--prior", "PRIOR"), "CLIP needs its model"),
        (("--retriever", "both", "--method", "brrp", "--prior", "PRIOR"), "CLIP needs its model"),
        (("--scenes", "5:9"), "The selection holds no scene"),
        (("--scenes", "5"), "is not A:B"),
    ],
)
def test_mistakes_are_told_before_the_work(place, tmp_path, options, text):
    filled = [place / "prior" if option == "PRIOR" else option for option in options]
    method = () if "--method" in options else ("--method", "vprism")
    result = run(place, *filled, *method, "-o", tmp_path / "out")
    assert result.exit_code in (1, 2)
    assert text in result.output
    assert not (tmp_path / "out" / "report.md").exists()


def started(place, output):
    """The command in a process of its own, as people run it."""
    words = ["-q", "eval", place / "scenes", "--method", "vprism", "--shift-masks", "0,1,2,3,4,5"]
    return subprocess.Popen(
        [sys.executable, "-m", "brrp_cli", *map(str, words), "-o", str(output), "--workers", "2"],
        cwd=Path(brrp_cli.__file__).parents[1],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell lets its background processes, and theirs, ignore Ctrl-C.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def rows_written(output):
    path = output / "rows.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def after_rows(process, output, count):
    """Wait until that many rows are there, or the process has ended."""
    while process.poll() is None and rows_written(output) < count:
        time.sleep(0.01)


@pytest.mark.long
@pytest.mark.parametrize(
    ("sent", "send", "least"),
    [
        (signal.SIGKILL, os.killpg, 3),
        # Its workers end the scenes that they hold, which may be all, beside the next run.
        (signal.SIGKILL, os.kill, 1),
        (signal.SIGINT, os.kill, 3),
        (signal.SIGTERM, os.kill, 3),
    ],
    ids=["kill", "kill alone", "ctrl-c", "terminate"],
)
def test_a_run_that_is_stopped_again_and_again_ends_with_the_same_table(
    place, tmp_path, sent, send, least
):
    """After each new row."""
    with started(place, tmp_path / "whole") as process:
        assert process.wait() == 3, process.stderr.read()
    output = tmp_path / "stopped"
    stops = 0
    while True:
        done = rows_written(output)
        with started(place, output) as process:
            after_rows(process, output, done + 1)
            if process.poll() is None:
                send(process.pid, sent)
            told = process.stderr.read()
        if process.returncode == 3:
            break
        stops += 1
        assert process.returncode == (-9 if sent == signal.SIGKILL else 128 + sent), told
        assert "Traceback" not in told
        if sent != signal.SIGKILL:
            assert "give the same command again to go on" in told
    assert stops >= least
    assert without_cost(rows_of(output)) == without_cost(rows_of(tmp_path / "whole"))


def test_a_line_that_was_cut_in_the_middle_of_the_rows_is_run_again(place, first, tmp_path):
    """A full disk may cut one worker's row, and let another write the next."""
    folder, _ = first
    shutil.copytree(folder, tmp_path / "cut")
    path = tmp_path / "cut" / "rows.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    lines[1] = lines[1][:40]
    path.write_bytes(b"".join(lines))
    kept, _ = finished(RowLog(path).read())
    assert 0 < len(kept) < len(lines)
