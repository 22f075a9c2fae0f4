"""Many frames of one source: one process, a folder each, what was done is left, what fails told."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from made_result import write_made_result
from sphere_method import METHOD
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.cli import main
from brrp_cli.commands.frames_summary import join_poses
from brrp_cli.commands.frames_there import results_with
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import OutputError
from brrp_cli.frames.npz import load_frame, save_frame
from brrp_cli.methods.registry import METHODS
from brrp_cli.shapes import solids


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Four frames of a box that moves; the third is cut."""
    folder = tmp_path_factory.mktemp("many") / "frames"
    folder.mkdir()
    for i in range(4):
        box = solids.moved(solids.box(0.07, 0.07, 0.1), y=0.03 * i)
        save_frame(photograph({1: in_camera(box, T_CAM_WORLD)}), folder / f"f{i}.npz")
    whole = (folder / "f2.npz").read_bytes()
    (folder / "f2.npz").write_bytes(whole[:500])
    return folder


@pytest.fixture
def source(made, tmp_path, monkeypatch) -> Path:
    monkeypatch.setitem(METHODS, METHOD.name, METHOD)
    return Path(shutil.copytree(made, tmp_path / "frames"))


def run(source: Path, *arguments: object) -> Result:
    result = CliRunner().invoke(
        main, ["reconstruct", str(source), "--method", "sphere", *map(str, arguments)]
    )
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_every_frame_has_a_folder_and_what_fails_ends_nothing(source, tmp_path):
    out = tmp_path / "out"
    result = run(source, "--frames", ":", "-o", out)
    assert result.exit_code == 3, result.output
    assert sorted(p.name for p in out.iterdir()) == [
        "f0.npz", "f1.npz", "f3.npz", "frames.json",
    ]  # fmt: skip
    for i in (0, 1, 3):
        seen = load_frame(out / f"f{i}.npz" / "frame.npz")
        assert np.array_equal(seen.segmap, load_frame(source / f"f{i}.npz").segmap)
        assert (out / f"f{i}.npz" / "object_1.ply").is_file()
    assert "Wrote 3 of 4 frames, 1 failed" in result.stdout
    assert result.stderr.count("Error: frame f2.npz: ") == 1
    told = json.loads((out / "frames.json").read_text())["frames"]
    assert [each["status"] for each in told] == ["done", "done", "failed", "done"]

    # The failed one alone is done again, and what was written stays as it is.
    box = in_camera(solids.moved(solids.box(0.07, 0.07, 0.1), y=0.06), T_CAM_WORLD)
    save_frame(photograph({1: box}), source / "f2.npz")
    before = {p: p.stat().st_mtime_ns for p in out.rglob("*.ply")}
    again = run(source, "--frames", ":", "-o", out)
    assert again.exit_code == 0, again.output
    assert "Wrote 1 of 4 frames, 3 were there" in again.stdout
    assert (out / "f2.npz" / "object_1.ply").is_file()
    assert {p: p.stat().st_mtime_ns for p in before} == before

    # With other settings nothing is taken for done.
    other = run(source, "--frames", ":", "-o", out, "--seed", 1)
    assert other.exit_code == 1 and "with other settings" in other.output
    assert "seed 0" in other.output and "seed 1" in other.output
    replaced = run(source, "--frames", "0:1", "-o", out, "--seed", 1, "--overwrite")
    assert replaced.exit_code == 0, replaced.output
    assert json.loads((out / "f0.npz" / "result.json").read_text())["seed"] == 1


def test_masks_that_were_made_otherwise_are_other_settings(tmp_path):
    folder = write_made_result(tmp_path / "out")
    record = json.loads((folder / "result.json").read_text())
    settings = {key: record[key] for key in ("method", "seed", "frame", "retriever", "config")}
    settings |= {"prior": record["prior"]["digest"], "segmentation": asdict(SegmentConfig())}
    settings |= {"masks": {"prompt": None, "all": False}}

    def with_masks(made):
        (folder / "result.json").write_text(json.dumps(record | {"segmentation": made}))
        return results_with(folder, settings) is not None

    assert with_masks(None) and with_masks(settings["segmentation"])
    with pytest.raises(OutputError, match="other settings"):
        with_masks(settings["segmentation"] | {"table": {}})


def test_a_range_chooses_and_json_tells_each_frame(source, tmp_path):
    out = tmp_path / "out"
    result = run(source, "--frames", "0:4:3", "-o", out, "--json")
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert [each["frame"] for each in report["frames"]] == ["f0.npz", "f3.npz"]
    assert [each["objects"][0]["id"] for each in report["frames"]] == [1, 1]


def test_units_and_masks_are_noted_for_the_first_frame_alone(source, tmp_path):
    for path in sorted(source.glob("*.npz")):
        if path.name != "f2.npz":
            frame = load_frame(path)
            save_frame(replace(frame, segmap=np.zeros_like(frame.segmap)), path)
    result = run(source, "--frames", ":2", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert result.stderr.count("Masks: made on the way") == 1
    assert {p.name for p in (tmp_path / "out").glob("*.png")} == {
        "f0.npz.masks.png",
        "f1.npz.masks.png",
    }


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--frames", "3"], "--index N"),
        (["--frames", "a:b"], "no range"),
        (["--frames", "9:"], "none of the 4 frames"),
        (["--frames", ":", "--index", "1"], "exclude each other"),
        (["--frames", ":", "--view"], "--html"),
        (["--frames", ":", "--masks", __file__], "--masks is of one frame, --frames of many"),
    ],
)
def test_what_does_not_go_with_many_frames_is_a_usage_error(arguments, says, source, tmp_path):
    result = run(source, *arguments, "-o", tmp_path / "out")
    assert result.exit_code == 2 and says in result.output
    assert not (tmp_path / "out").exists()


def test_a_folder_of_other_things_is_not_mixed_with(source, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").touch()
    for more in ([], ["--overwrite"]):
        result = run(source, "--frames", ":", "-o", tmp_path / "out", *more)
        assert result.exit_code == 1 and "holds other things" in result.output
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("command", ["reconstruct", "frame", "segment"])
def test_list_says_what_a_source_holds_and_writes_nothing(command, source):
    before = sorted(source.parent.iterdir())
    result = CliRunner().invoke(main, [command, str(source), "--list"])
    assert result.exit_code == 0, result.output
    assert "4 frames" in result.output
    assert [line.split() for line in result.output.splitlines() if ".npz" in line] == [
        [str(i), f"f{i}.npz"] for i in range(4)
    ]
    assert sorted(source.parent.iterdir()) == before
    none = CliRunner().invoke(main, [command, "--list"])
    assert none.exit_code == 2 and "SOURCE" in none.output


def test_what_is_asked_for_later_is_written_beside_what_was_there(source, tmp_path):
    out = tmp_path / "out"
    assert run(source, "--frames", ":2", "-o", out).exit_code == 0
    before = {p: p.stat().st_mtime_ns for p in out.rglob("*.ply")}
    asked = ["--frames", ":2", "-o", out, "--html", "--collision", "hull", "--grasp"]
    again = run(source, *asked)
    assert again.exit_code == 0, again.output
    for name in ("f0.npz", "f1.npz"):
        for written in ("view.html", "grasps.json", "plan/plan.json"):
            assert (out / name / written).is_file()
        assert f"{name}: was there; new: plan/plan.json, grasps.json, view.html" in again.stdout
    assert {p: p.stat().st_mtime_ns for p in before} == before
    assert "new:" not in run(source, *asked).stdout

    other = run(source, *asked, "--gripper", "robotiq-2f-85", "--confidence", 0.9)
    assert "f0.npz: was there; new: plan/plan.json, grasps.json, view.html" in other.stdout
    hand = json.loads((out / "f0.npz" / "grasps.json").read_text())["gripper"]["name"]
    assert hand == "Robotiq 2F-85"
    assert json.loads((out / "f0.npz" / "plan" / "plan.json").read_text())["confidence"] == 0.9


def test_of_two_frames_with_one_folder_both_are_named(source, tmp_path):
    for name in ("g 1.npz", "g_1.npz"):
        shutil.copy(source / "f0.npz", source / name)
    result = run(source, "--frames", ":", "-o", tmp_path / "out")
    assert result.exit_code == 1 and "found:    g 1.npz and g_1.npz" in result.output
    assert f"where:    {tmp_path / 'out' / 'g_1.npz'}" in result.output
    assert run(source, "--frames", ":2", "-o", tmp_path / "out").exit_code == 0


def test_what_was_told_of_other_frames_stays(source, tmp_path):
    out = tmp_path / "out"
    assert run(source, "--frames", "3:", "-o", out).exit_code == 0
    assert run(source, "--frames", ":1", "-o", out).exit_code == 0
    told = json.loads((out / "frames.json").read_text())["frames"]
    assert [each["frame"] for each in told] == ["f0.npz", "f3.npz"]
    assert all(each["status"] == "done" and each["objects"] for each in told)
    assert run(source, "--frames", ":1", "-o", out).exit_code == 0
    there = json.loads((out / "frames.json").read_text())["frames"][0]
    assert there == told[0] | {"status": "was there"}


def test_poses_of_frames_that_are_named_by_words_have_images_of_their_own(tmp_path):
    header, row = "scene_id,im_id,obj_id,score,R,t,time", "0,0,4,0.9,1 0 0,1 2 3,0.5"
    names = ["a", "b", "c"]
    for name in ("a", "c"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "poses_bop.csv").write_text(f"{header}\n{row}\n{row}\n")
    told = [{"frame": name, "folder": name} for name in names]
    join_poses(tmp_path, told, names)
    lines = (tmp_path / "poses_bop.csv").read_text().splitlines()
    assert lines == [header, *[row] * 2, *[row.replace("0,0,", "0,2,", 1)] * 2]


@pytest.mark.parametrize(
    ("source", "scene", "image"),
    [("2024/b.npz", 0, 1), ("bop/000048/000003", 48, 3), ("2024-05-12.bag", 0, 1)],
)
def test_poses_of_a_single_frame_have_its_place_unless_it_is_numbered(
    source, scene, image, tmp_path
):
    header, row = "scene_id,im_id,obj_id,score,R,t,time", "4,0.9,1 0 0,1 2 3,0.5"
    (tmp_path / "b").mkdir()
    told = [{"frame": name, "folder": name} for name in ("a", "b")]
    (tmp_path / "b" / "result.json").write_text(json.dumps({"source": source}))
    ids = "0,2024" if scene == 0 else f"{scene},{image}"
    (tmp_path / "b" / "poses_bop.csv").write_text(f"{header}\n{ids},{row}\n")
    join_poses(tmp_path, told, ["a", "b"], Path("2024-05-12.bag"))
    lines = (tmp_path / "poses_bop.csv").read_text().splitlines()
    assert lines == [header, f"{scene},{image},{row}"]


def test_settings_that_differ_are_named_with_their_values(source, tmp_path):
    out = tmp_path / "out"
    assert run(source, "--frames", ":1", "-o", out).exit_code == 0
    path = out / "f0.npz" / "result.json"
    record = json.loads(path.read_text())
    made = asdict(SegmentConfig())
    made["table"]["tolerance"] = 0.5
    path.write_text(json.dumps(record | {"segmentation": made}))
    result = run(source, "--frames", ":1", "-o", out)
    assert result.exit_code == 1
    assert "found:    segmentation.table.tolerance 0.5" in result.output


def test_a_frame_that_was_corrected_since_fails_alone(source, tmp_path):
    out = tmp_path / "out"
    assert run(source, "--frames", ":2", "-o", out).exit_code == 0
    path = out / "f0.npz" / "frame.npz"
    frame = load_frame(path)
    half = np.arange(frame.shape[1]) < np.median(np.nonzero(frame.segmap)[1])
    save_frame(frame.with_masks(np.where(half, frame.segmap, 0)), path)
    result = run(source, "--frames", ":2", "-o", out, "--grasp")
    assert result.exit_code == 3, result.output
    assert "Error: frame f0.npz: " in result.stderr and "other masks" in result.stderr
    assert "f1.npz: was there; new: grasps.json" in result.stdout
    told = json.loads((out / "frames.json").read_text())["frames"]
    assert [each["status"] for each in told] == ["failed", "was there"]


def moved(folder: Path, name: str) -> None:
    """Another picture under that name."""
    box = in_camera(solids.moved(solids.box(0.05, 0.09, 0.12), y=-0.04), T_CAM_WORLD)
    save_frame(photograph({1: box}), folder / name)


def digests(out: Path) -> dict[str, str]:
    return {
        path.parent.name: json.loads(path.read_text())["source_sha256"]
        for path in sorted(out.glob("*/result.json"))
    }


def test_frames_of_another_source_are_not_there_and_are_not_replaced_unasked(source, tmp_path):
    out, other = tmp_path / "out", tmp_path / "other"
    assert run(source, "--frames", ":2", "-o", out).exit_code == 0
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    shutil.copytree(source, other)
    moved(other, "f1.npz")
    result = run(other, "--frames", ":2", "-o", out)
    assert result.exit_code == 1 and "from another source before" in result.output
    assert f"results of {other / 'f1.npz'}" in result.output
    assert f"results of {source / 'f1.npz'}" in result.output
    assert "--overwrite" in result.output and "Traceback" not in result.output
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before
    assert run(other, "--frames", ":2", "-o", out, "--overwrite").exit_code == 0
    written, asked = load_frame(out / "f1.npz" / "frame.npz"), load_frame(other / "f1.npz")
    assert np.array_equal(written.segmap, asked.segmap)
    assert json.loads((out / "frames.json").read_text())["source"] == str(other)


def test_the_same_frames_in_another_place_are_there(source, tmp_path):
    out, other = tmp_path / "out", tmp_path / "other"
    assert run(source, "--frames", ":2", "-o", out).exit_code == 0
    source.rename(other)
    again = run(other, "--frames", ":2", "-o", out)
    assert again.exit_code == 0 and "2 of 2 frames were there and are left" in again.stderr


def test_a_frame_whose_masks_were_corrected_at_its_source_is_done_again(source, tmp_path):
    out = tmp_path / "out"
    assert run(source, "--frames", ":2", "-o", out, "--html").exit_code == 0
    first = digests(out)
    frame = load_frame(source / "f0.npz")
    save_frame(frame.with_masks(np.where(frame.segmap == 1, 7, 0)), source / "f0.npz")
    (out / "f0.npz.masks.png").touch()
    kept = (out / "f1.npz" / "object_1.ply").stat().st_mtime_ns
    again = run(source, "--frames", ":2", "-o", out)
    assert again.exit_code == 0, again.output
    assert "1 frame was reconstructed from other images or masks and is done again" in again.stderr
    assert "1 of 2 frames was there and is left" in again.stderr
    assert "Wrote 1 of 2 frames, 1 was there" in again.stdout
    assert (out / "f0.npz" / "object_7.ply").is_file()
    assert not (out / "f0.npz" / "object_1.ply").exists()
    assert not (out / "f0.npz" / "view.html").exists(), "it showed the masks before"
    assert not (out / "f0.npz.masks.png").exists()
    assert (out / "f1.npz" / "object_1.ply").stat().st_mtime_ns == kept
    now = digests(out)
    assert now["f0.npz"] != first["f0.npz"] and now["f1.npz"] == first["f1.npz"]
    # Nothing changed since: nothing is done.
    assert "Wrote 0 of 2 frames, 2 were there" in run(source, "--frames", ":2", "-o", out).stdout


def test_masks_that_are_made_on_the_way_are_no_change_of_the_source(source, tmp_path):
    save_frame(load_frame(source / "f0.npz").without_masks(), source / "f0.npz")
    out = tmp_path / "out"
    assert run(source, "--frames", ":1", "-o", out).exit_code == 0
    again = run(source, "--frames", ":1", "-o", out)
    assert "Wrote 0 of 1 frame, 1 was there" in again.stdout, again.output
    assert "Masks: made" not in again.stderr


def test_masks_that_were_asked_for_otherwise_are_told(source, tmp_path):
    save_frame(load_frame(source / "f0.npz").without_masks(), source / "f0.npz")
    out = tmp_path / "out"
    assert run(source, "--frames", ":2", "-o", out).exit_code == 0
    masks = [json.loads((out / f"f{i}.npz/result.json").read_text())["masks"] for i in (0, 1)]
    assert masks == [{"prompt": None, "all": False}, None]
    every = run(source, "--frames", ":1", "-o", out, "--all")
    assert every.exit_code == 1
    assert (
        "expected: masks.all true" in every.output and "found:    masks.all false" in every.output
    )
    # The other one has masks of its own, which a prompt would replace and --all would not.
    prompted = run(source, "--frames", "1:2", "-o", out, "--prompt", "mug")
    assert prompted.exit_code == 1 and "expected: masks.prompt mug" in prompted.output
    assert "1 was there" in run(source, "--frames", "1:2", "-o", out, "--all").stdout


def test_results_that_do_not_tell_of_which_frame_they_are_stay(source, tmp_path):
    out = tmp_path / "out"
    assert run(source, "--frames", ":1", "-o", out).exit_code == 0
    path = out / "f0.npz" / "result.json"
    record = json.loads(path.read_text())
    del record["source_sha256"]
    path.write_text(json.dumps(record))
    moved(source, "f0.npz")
    assert "Wrote 0 of 1 frame, 1 was there" in run(source, "--frames", ":1", "-o", out).stdout


def test_a_frame_that_can_be_read_no_more_fails_and_its_results_stay(source, tmp_path):
    out = tmp_path / "out"
    assert run(source, "--frames", ":2", "-o", out).exit_code == 0
    (source / "f0.npz").write_bytes((source / "f0.npz").read_bytes()[:500])
    again = run(source, "--frames", ":2", "-o", out)
    assert again.exit_code == 3 and again.stderr.count("Error: frame f0.npz: ") == 1
    assert "other images or masks" not in again.stderr, "nobody knows what it shows now"
    assert (out / "f0.npz" / "object_1.ply").is_file()
