"""From a camera's images to meshes in one command, masks made on the way."""

from __future__ import annotations

import base64
import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from sphere_method import METHOD
from table_scene import T_CAM_WORLD, K, in_camera, photograph

from brrp_cli.cli import main
from brrp_cli.frames.npz import load_frame
from brrp_cli.methods.registry import METHODS
from brrp_cli.shapes import solids


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    """color.png, depth.png and camera.json of two boxes."""
    folder = tmp_path_factory.mktemp("dump") / "000000"
    folder.mkdir()
    things = {
        i: in_camera(solids.moved(solids.box(0.07, 0.07, 0.1), y=y), T_CAM_WORLD)
        for i, y in ((1, -0.09), (2, 0.09))
    }
    frame = photograph(things)
    Image.fromarray(frame.rgb).save(folder / "color.png")
    depth = np.nan_to_num(frame.points[..., 2])
    Image.fromarray((depth * 1000).round().astype(np.uint16)).save(folder / "depth.png")
    Image.fromarray(frame.segmap.astype(np.uint8)).save(folder / "m.png")
    (folder / "camera.json").write_text(json.dumps({"K": K.tolist()}))
    return folder


@pytest.fixture
def sphere(monkeypatch):
    """The quickest method, where it does not matter which one it is."""
    monkeypatch.setitem(METHODS, METHOD.name, METHOD)


def run(*arguments, method="sphere"):
    return CliRunner().invoke(main, ["reconstruct", *map(str, arguments), "--method", method])


def files(folder):
    return [
        "--color", folder / "color.png", "--depth", folder / "depth.png",
        "--intrinsics", folder / "camera.json",
    ]  # fmt: skip


def test_images_become_meshes_and_a_page_in_one_command(
    images, sphere, tmp_path, caplog, monkeypatch
):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    out = tmp_path / "out"
    with caplog.at_level("INFO"):
        result = run(*files(images), "-o", out, "--collision", "hull", "--view")
    assert result.exit_code == 0, result.output
    assert opened == [(out / "view.html").resolve().as_uri()]
    # The page shows the collision shapes too: they are made before it.
    glb = re.search(r'<script[^>]* id="glb">(.*?)</script>', (out / "view.html").read_text(), re.S)
    assert b"plan_object_2_part_0" in base64.b64decode(glb[1])
    assert len(list(out.glob("object_*.ply"))) == 2
    assert load_frame(out / "frame.npz").object_ids == [1, 2]
    assert (tmp_path / "out.masks.png").is_file()
    assert "taken as millimetres" in caplog.text
    assert "out.masks.png" in result.output
    assert "brrp segment" in result.output
    # What was written is corrected, and reconstructed again, by the same commands.
    fixed = tmp_path / "fixed.npz"
    arguments = ["segment", out / "frame.npz", "--drop", "1", "-o", fixed]
    assert CliRunner().invoke(main, list(map(str, arguments))).exit_code == 0
    again = run(fixed)
    assert again.exit_code == 0, again.output
    assert [path.name for path in (tmp_path / "fixed_sphere").glob("*.ply")] == ["object_2.ply"]


def test_a_folder_becomes_meshes_beside_it(images, sphere):
    result = run(images)
    assert result.exit_code == 0, result.output
    assert (images.parent / "000000_sphere" / "result.json").is_file()
    refused = run(images)
    assert refused.exit_code == 1
    assert "--overwrite" in refused.output


def test_a_file_configures_masks_and_method_and_is_kept_with_the_result(images, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("hinge_spacing = 0.06\n[segmentation]\nmin_area = 0.0009\n")
    result = run(*files(images), "--config", path, "-o", tmp_path / "out", method="vprism")
    assert result.exit_code == 0, result.output
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert record["config"]["hinge_spacing"] == 0.06 and record["config"]["gamma"] == 1000.0
    assert record["segmentation"]["min_area"] == 0.0009
    assert record["segmentation"]["table"]["tolerance"] == 0.01
    path.write_text("[segmentation]\nmin_area = 1.0\n")
    result = run(*files(images), "--config", path, "-o", tmp_path / "none", method="vprism")
    assert result.exit_code == 1 and "Nothing stands on the table" in result.output


def test_masks_that_are_given_are_used_and_a_page_may_stay_closed(
    images, sphere, tmp_path, monkeypatch
):
    monkeypatch.setattr("webbrowser.open", lambda address: pytest.fail("it was opened"))
    out = tmp_path / "out"
    result = run(*files(images), "--masks", images / "m.png", "-o", out, "--html")
    assert result.exit_code == 0, result.output
    assert str(out / "view.html") in result.output and (out / "view.html").is_file()
    assert not (tmp_path / "out.masks.png").exists()


def test_masks_of_one_s_own_for_a_source_leave_no_picture_of_those_made_before(
    images, sphere, tmp_path
):
    out, picture = tmp_path / "out", tmp_path / "out.masks.png"
    assert run(images, "-o", out).exit_code == 0
    assert picture.is_file()
    one = np.asarray(Image.open(images / "m.png")) == 2
    Image.fromarray(np.where(one, 5, 0).astype(np.uint8)).save(tmp_path / "own.png")
    result = run(images, "--masks", tmp_path / "own.png", "-o", out, "--overwrite")
    assert result.exit_code == 0, result.output
    assert [path.name for path in out.glob("*.ply")] == ["object_5.ply"]
    assert json.loads((out / "result.json").read_text())["segmentation"] is None
    assert not picture.exists()
    # Where masks are made again, so is their picture.
    assert run(images, "-o", out, "--overwrite").exit_code == 0
    assert picture.is_file()


def test_the_picture_of_masks_of_another_folder_of_results_stays(images, sphere, tmp_path):
    (tmp_path / "out.masks.png").write_text("mine")
    result = run(*files(images), "--masks", images / "m.png", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert (tmp_path / "out.masks.png").read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "missing --color, --depth, --intrinsics"),
        (["--color", "c.png"], "missing --depth, --intrinsics"),
        (["scene", "--color", "c.png"], "either SOURCE or"),
        (["scene", "--masks-dir", "d"], "goes with --prompt"),
    ],
)
def test_wrong_usage_is_exit_code_2(arguments, message):
    result = run(*arguments, method="vprism")
    assert result.exit_code == 2
    assert message in result.output
