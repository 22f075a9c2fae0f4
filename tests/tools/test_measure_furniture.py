"""What the tool that measures bins and shelves says of made scenes, whose walls are known."""

from __future__ import annotations

import json
import shutil
import sys

import numpy as np
import pytest
import trimesh

pytest.importorskip("pybullet")

from click.testing import CliRunner
from make_scenes import main as make_scenes
from measure_furniture import Found, bin_points, count_grasps, face_points, in_view, line, main
from tabletop.bin import draw_bin
from tabletop.furniture import FILE, read_walls, write_furniture
from tabletop.platform import draw_platform
from tabletop.shelf import draw_shelf

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.geometry import similarity
from brrp_cli.grasping.grasp import Grasp, GraspPlan, ObjectGrasps
from brrp_cli.grasping.gripper_file import DEFAULT, open_gripper

FINGER = np.array([[0.045, 0.0, 0.1]])  # inside the right one of a hand that is open by 8 cm


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    root = tmp_path_factory.mktemp("data")
    for number, size in enumerate([(0.08, 0.06, 0.05), (0.05, 0.05, 0.09)]):
        path = root / "meshes" / f"{number}" / "google_16k" / "textured.obj"
        path.parent.mkdir(parents=True)
        trimesh.creation.box(size).export(path)
    return root


def made(root, *options):
    options = ["--scenes", 2, "--views", 1, "--size", "320x240", *options]
    arguments = ["--meshes", root / "meshes", "-o", root / options[-1], *options]
    result = CliRunner().invoke(make_scenes, [str(each) for each in arguments])
    assert result.exit_code == 0, result.output
    return root / options[-1]


@pytest.fixture(scope="module")
def scenes(root):
    return made(root, "--elevation", 60, 80, "--bin")


def said(monkeypatch, capsys, *arguments):
    monkeypatch.setattr(sys, "argv", ["measure_furniture.py", *map(str, arguments)])
    main()
    return capsys.readouterr().out


def test_walls_are_where_they_were_made(scenes, monkeypatch, capsys):
    out = said(monkeypatch, capsys, scenes)
    assert "bins 2/2" in out and "false 0/" in out
    off = float(out.partition("off ")[2].split(" mm")[0])
    assert off < 4.0


def test_a_shelf_is_where_it_was_made(root, monkeypatch, capsys):
    out = said(monkeypatch, capsys, made(root, "--elevation", 15, 25, "--shelf"))
    assert "shelves 2/2" in out and "false 0/" in out
    found, shown = map(int, out.partition("walls ")[2].split(",")[0].split("/"))
    assert found >= 4 and shown <= 8
    assert float(out.partition("off ")[2].split(" mm")[0]) < 4.0


def test_walls_that_are_elsewhere_are_false(scenes, monkeypatch, capsys):
    path = sorted(scenes.glob(f"*/{FILE}"))[0]
    kept = path.read_text()
    record = json.loads(kept)
    for wall in record["panels"][1:]:
        wall["position"][2] += 1.0
    path.write_text(json.dumps(record))
    try:
        out = said(monkeypatch, capsys, scenes, "--scenes", 1)
    finally:
        path.write_text(kept)
    false, models = out.partition("false ")[2].strip().split("/")
    assert int(false) == int(models) > 2 and "off nan" in out


def test_a_platform_is_where_it_was_made(root, monkeypatch, capsys):
    out = said(monkeypatch, capsys, made(root, "--elevation", 40, 60, "--platform"))
    assert "platforms 2/2, walls 2/2" in out and "false 0/2" in out
    assert float(out.partition("off ")[2].split()[0]) < 2.0


def test_scenes_without_a_bin_are_told(tmp_path, scenes, monkeypatch):
    bare = shutil.copytree(scenes, tmp_path / "bare")
    for path in bare.glob(f"*/{FILE}"):
        path.unlink()
    for folder, what in ((tmp_path / "none", "none"), (bare, "has no bin")):
        monkeypatch.setattr(sys, "argv", ["measure_furniture.py", str(folder)])
        with pytest.raises(SystemExit, match=what):
            main()


def test_walls_are_read_as_they_were_written(tmp_path):
    made = draw_bin(np.random.default_rng(0))
    write_furniture(made, tmp_path)
    kind, walls = read_walls(tmp_path)
    assert kind == "bin" and len(walls) == 4
    assert np.vstack([wall.vertices for wall in walls])[:, 2].max() == pytest.approx(
        made.height, abs=made.thickness
    )
    platform = draw_platform(np.random.default_rng(0))
    write_furniture(platform, tmp_path)
    kind, (solid,) = read_walls(tmp_path)
    assert kind == "platform" and solid.extents[2] == pytest.approx(platform.thickness)
    shelf = draw_shelf(np.random.default_rng(0)).over(np.array([[0.0, 0.0, 0.3]]))
    write_furniture(shelf, tmp_path)
    kind, walls = read_walls(tmp_path)
    assert kind == "shelf" and len(walls) == 4, "a back, two sides and a board above"
    assert min(wall.bounds[0, 2] for wall in walls) == pytest.approx(-shelf.thickness)


def test_points_of_a_bins_wall_lie_in_its_middle():
    rim = np.array([[0, 0.01, 1], [2, 0.01, 1], [0, -0.01, 1], [2, -0.01, 1.0]])
    points = bin_points(np.concatenate([rim, rim - [0, 0.1, 1]]))
    assert len(points) == 14
    np.testing.assert_allclose(points[:7, 1:], [[0, 1]] * 7, atol=1e-12)
    np.testing.assert_allclose(points[7:, 1:], [[-0.1, 0]] * 7, atol=1e-12)
    assert points[:, 0].min() == 0.25 and points[:, 0].max() == 1.75


def test_points_of_a_slab_lie_on_its_face():
    face = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0.0]])
    points = face_points(np.concatenate([face, face - [0, 0, 0.01]]))
    np.testing.assert_allclose(points[0], [1, 0.5, 0])
    np.testing.assert_allclose(
        [points.min(axis=0), points.max(axis=0)], [[0.2, 0.1, 0], [1.8, 0.9, 0]]
    )


def test_a_wall_beside_the_image_is_not_asked_for():
    K = np.array([[100.0, 0, 50], [0, 100.0, 50], [0, 0, 1]])
    wall = trimesh.creation.box([0.2, 0.01, 0.1])
    ahead, aside = (
        wall.copy().apply_transform(similarity(translation=np.array([x, 0.0, 1.0])))
        for x in (0.0, 0.55)
    )
    assert in_view(ahead, K, (100, 100)) and not in_view(aside, K, (100, 100))


def test_hands_that_hold_a_point_of_a_wall_are_counted():
    hand = open_gripper(DEFAULT)
    T = np.eye(4)
    away = similarity(translation=np.array([0.5, 0.0, 0.0]))
    grasps = [Grasp(1, at, 0.08, 0.04, 1.0, 1.0, np.zeros((2, 3))) for at in (T, away)]
    plan = GraspPlan(
        [ObjectGrasps(1, grasps), ObjectGrasps(2, [])], hand, GraspConfig(), "all", 0.5, 10, 0
    )
    found = Found()
    count_grasps(plan, FINGER, found)
    assert (found.grasps, found.swept, found.best, found.best_swept) == (2, 1, 1, 1)
    assert "grasps 1/2, best 1/1" in line("set", found, True)
    assert "grasps" not in line("set", found, False)
