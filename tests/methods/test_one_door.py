"""A method that is a file and one line: Python, the commands, eval and files take it as it is."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import sphere_method
import trimesh
from click.testing import CliRunner
from sphere_method import METHOD, SphereConfig
from tiny_scenes import write_meshes, write_scene

import brrp_cli
from brrp_cli import (
    Reconstructor,
    load_config,
    open_posterior,
    open_result,
    read_frame,
    reconstruct,
)
from brrp_cli.cli import main
from brrp_cli.config import preset
from brrp_cli.errors import BrrpError
from brrp_cli.methods.registry import METHODS

LEVEL = SphereConfig().surface.level
ROOT = Path(brrp_cli.__file__).parents[1]


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(METHODS, METHOD.name, METHOD)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    write_meshes(folder / "data" / "shapes")
    write_scene(folder / "scenes" / "a", {9: ("ball", 0.02, 0.1), 4: ("can", 0.0, -0.1)})
    return folder


def command(place: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, where the script has registered the method."""
    return subprocess.run(
        [sys.executable, sphere_method.__file__, *map(str, arguments)],
        cwd=ROOT,
        env={"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(place / "cache"), "PATH": ""},
        capture_output=True,
        text=True,
    )


@pytest.fixture(scope="module")
def out(place):
    done = command(
        place, "reconstruct", place / "scenes/a/0000", "--method", "sphere", "-o", place / "out"
    )
    assert done.returncode == 0, done.stderr
    return place / "out"


def test_the_command_writes_its_meshes_and_its_record(out):
    record = json.loads((out / "result.json").read_text())
    assert record["method"] == "sphere" and record["config"]["share"] == 1.0
    assert [item["status"] for item in record["objects"]] == ["ok", "ok"]
    mesh = trimesh.load_mesh(out / "object_9.ply")
    assert mesh.is_watertight
    # Of the ball of 6 cm one half is seen: the middle of its box is nearer to the camera.
    assert 0.8 < (mesh.volume / (4 / 3 * np.pi * 0.06**3)) ** (1 / 3) < 1.2


def test_python_gives_what_the_command_gives(registered, place, out):
    frame = read_frame(place / "scenes/a/0000")
    result = reconstruct(frame, method="sphere")
    session = Reconstructor(method="sphere")(frame)
    for item, again in zip(result.objects, session.objects, strict=True):
        kept = trimesh.load_mesh(out / f"object_{item.object_id}.ply", process=False)
        np.testing.assert_array_equal(kept.vertices, item.surface.vertices.astype(np.float32))
        np.testing.assert_array_equal(again.surface.vertices, item.surface.vertices)
    halved = reconstruct(frame, method="sphere", config=METHOD.preset("half"))
    assert halved.objects[0].posterior.radius == result.objects[0].posterior.radius / 2


def test_its_posterior_reads_and_writes_itself(registered, out):
    found = open_posterior(out / "posterior.h5")
    assert set(found) == {4, 9} and found[4].width is found[9].width
    mesh = trimesh.load_mesh(out / "object_9.ply", process=False)
    np.testing.assert_allclose(found[9].probability(mesh.vertices), LEVEL, atol=0.02)
    with h5py.File(out / "posterior.h5") as file:
        assert list(file["shared"]) == ["width"], "what all objects have is written once"
    assert open_result(out).posteriors[4].radius == found[4].radius


def test_a_posterior_of_a_method_that_is_not_registered_is_refused(out):
    with pytest.raises(BrrpError, match="method that is not here") as error:
        open_posterior(out / "posterior.h5")
    assert error.value.found == "sphere" and "vprism" in error.value.expected


@pytest.mark.slow
def test_eval_measures_it_in_its_workers(place):
    options = ["--method", "sphere", "--preset", "tight,half", "--workers", 1, "-o", place / "eval"]
    done = command(place, "eval", place / "scenes", "--data-root", place / "data", *options)
    assert done.returncode == 0, done.stderr
    with (place / "eval" / "metrics.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    iou = {(row["preset"], row["object_id"]): float(row["iou"]) for row in rows}
    assert len(iou) == 4 and iou["tight", "9"] > 0.4
    assert iou["half", "9"] < 0.5 * iou["tight", "9"]
    assert "sphere tight" in (place / "eval" / "report.md").read_text()


@pytest.mark.slow
def test_a_file_configures_it_everywhere(registered, place):
    path = place / "mine.toml"
    path.write_text('method = "sphere"\nshare = 0.5\n[surface]\nspacing = 0.004\n')
    frame = place / "scenes/a/0000"
    options = ["--method", "sphere", "--config", path]
    done = command(place, "reconstruct", frame, *options, "-o", place / "configured")
    assert done.returncode == 0, done.stderr
    record = json.loads((place / "configured" / "result.json").read_text())
    assert record["config"]["share"] == 0.5 and record["config"]["surface"]["spacing"] == 0.004
    assert record["segmentation"] is None, "its masks came with it"
    result = reconstruct(
        read_frame(frame), method="sphere", config=load_config(path, method="sphere")
    )
    mesh = trimesh.load_mesh(place / "configured" / "object_9.ply", process=False)
    vertices = result.objects[1].surface.vertices
    np.testing.assert_array_equal(mesh.vertices, vertices.astype(np.float32))
    where = ["--data-root", place / "data", "-o", place / "compared", "--workers", 1]
    done = command(place, "eval", place / "scenes", *options, "--preset", "tight,half", *where)
    assert done.returncode == 0, done.stderr
    with (place / "compared" / "metrics.csv").open(newline="") as stream:
        iou = {(r["preset"], r["object_id"]): r["iou"] for r in csv.DictReader(stream)}
    # The file says what sets the presets apart, so that they are one.
    assert set(iou) == {(f"{p}+mine", i) for p in ("tight", "half") for i in ("4", "9")}
    assert iou["tight+mine", "9"] == iou["half+mine", "9"]


def test_help_tells_of_it(place):
    text = " ".join(command(place, "reconstruct", "--help").stdout.split())
    assert "sphere: a ball around each object; needs nothing but a frame." in text


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--method", "sphere", "--prior", "p"], "needs nothing but a frame, so leave out --prior"),
        (["--method", "sphere", "--k", "2"], "leave out --k"),
        (["--method", "sphere", "--preset", "paper"], "no --preset paper, but tight, half"),
        (["--method", "sphere", "--device", "cuda"], "runs on the CPU alone"),
        (["--method", "sphere", "--weights", "w"], "--weights means nothing to --method sphere"),
        (["--method", "shpere"], "Did you mean 'sphere'?"),
    ],
)
def test_what_it_has_no_use_for_is_refused(registered, place, options, told):
    frame = str(place / "scenes/a/0000")
    done = CliRunner().invoke(main, ["reconstruct", frame, "-o", str(place / "no"), *options])
    assert done.exit_code == 2 and told in " ".join(done.output.split())
    assert not (place / "no").exists()


def test_another_methods_configuration_is_refused(registered, place):
    frame = read_frame(place / "scenes/a/0000")
    with pytest.raises(BrrpError, match="no configuration of sphere") as error:
        reconstruct(frame, method="sphere", config=preset("paper"))
    assert error.value.expected == SphereConfig.__name__


@pytest.mark.parametrize("given", ["frame.npz", Path("frame.npz"), None])
def test_what_is_no_frame_is_told_how_to_become_one(registered, given):
    with Reconstructor(method="sphere") as session:
        for run in (session, lambda frame: reconstruct(frame, method="sphere")):
            with pytest.raises(BrrpError, match=r"That is no frame(.|\n)*load_frame"):
                run(given)
