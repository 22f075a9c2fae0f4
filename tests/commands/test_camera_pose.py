"""--camera-pose: the camera's place in the world from a file, and meshes in the world's frame."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from PIL import Image
from sphere_method import METHOD
from table_scene import T_CAM_WORLD, T_WORLD_CAM, K, in_camera, photograph

from brrp_cli.cli import main
from brrp_cli.frames.npz import load_frame
from brrp_cli.methods.registry import METHODS
from brrp_cli.shapes import solids


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Images of a box at the world's origin."""
    monkeypatch.setitem(METHODS, METHOD.name, METHOD)
    seen = photograph({1: in_camera(solids.box(0.07, 0.07, 0.1), T_CAM_WORLD)})
    Image.fromarray(seen.rgb).save(tmp_path / "c.png")
    depth = np.nan_to_num(seen.points[..., 2])
    Image.fromarray((depth * 1000).round().astype(np.uint16)).save(tmp_path / "d.png")
    Image.fromarray(seen.segmap.astype(np.uint8)).save(tmp_path / "m.png")
    (tmp_path / "k.json").write_text(json.dumps({"K": K.tolist()}))
    return tmp_path


def run(folder, pose, *more, command="reconstruct", masks="m.png"):
    files = {"--color": "c.png", "--depth": "d.png", "--intrinsics": "k.json", "--masks": masks}
    arguments = [command, *(str(x) for o, n in files.items() for x in (o, folder / n))]
    arguments += ["--camera-pose", str(folder / pose), *map(str, more)]
    return CliRunner().invoke(main, arguments)


@pytest.mark.parametrize("kind", ["nested.json", "flat.json", "keyed.json", "t.npy", "t.txt"])
def test_every_way_to_write_a_pose_is_read(kind, folder):
    path = folder / kind
    rows = T_WORLD_CAM.tolist()
    if path.suffix == ".npy":
        np.save(path, T_WORLD_CAM)
    elif path.suffix == ".txt":
        np.savetxt(path, T_WORLD_CAM)
    else:
        flat = T_WORLD_CAM.ravel().tolist()
        written = {"nested.json": rows, "flat.json": flat, "keyed.json": {"T_world_cam": rows}}
        path.write_text(json.dumps(written[kind]))
    result = run(folder, kind, "-o", folder / "f.npz", command="frame")
    assert result.exit_code == 0, result.output
    assert load_frame(folder / "f.npz").T_world_cam == pytest.approx(T_WORLD_CAM, abs=1e-9)


def test_meshes_stand_in_the_world(folder):
    np.save(folder / "t.npy", T_WORLD_CAM)
    arguments = ["--frame", "world", "--method", "sphere", "-o", folder / "out"]
    result = run(folder, "t.npy", *arguments)
    assert result.exit_code == 0, result.output
    ball = trimesh.load_mesh(folder / "out" / "object_1.ply")
    assert ball.bounds.mean(axis=0) == pytest.approx([0, 0, 0.05], abs=0.03)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "No such file"),
        ("[[1, 0], [0, 1]]", "no 4 x 4 matrix"),
        ("[[1,", "cannot be read"),
        ('{"a": 1}', "no pose of the camera"),
        ('{"pose": "here"}', "no 4 x 4 matrix"),
        (json.dumps((2 * np.eye(4)).tolist()), "no rigid transform"),
        (json.dumps(T_WORLD_CAM.T.tolist()), "transpose it"),
        (json.dumps((T_WORLD_CAM @ np.diag([1, 1, -1, 1])).tolist()), "left-handed"),
    ],
)
def test_a_pose_that_is_none_is_told_by_its_file(text, says, folder):
    if text is not None:
        (folder / "t.json").write_text(text)
    result = run(folder, "t.json", "-o", folder / "f.npz", command="frame")
    assert result.exit_code == 1 and result.output.count("Error: ") == 1, result.output
    assert says in result.output and f"where:    {folder / 't.json'}" in result.output
    assert "fix: " in result.output
    assert says == "transpose it" or "transpose" not in result.output
    assert not (folder / "f.npz").exists()


@pytest.mark.parametrize("suffix", [".json", ".txt"])
def test_a_pose_that_an_editor_marked_as_utf_8_is_read(suffix, folder):
    text = json.dumps(T_WORLD_CAM.tolist())
    text = text if suffix == ".json" else " ".join(map(str, T_WORLD_CAM.ravel()))
    (folder / f"t{suffix}").write_text(text, encoding="utf-8-sig")
    result = run(folder, f"t{suffix}", "-o", folder / "f.npz", command="frame")
    assert result.exit_code == 0, result.output
    assert load_frame(folder / "f.npz").T_world_cam == pytest.approx(T_WORLD_CAM)
