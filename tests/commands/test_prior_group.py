"""`brrp prior ...`, through the commands."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result
from PIL import Image

from brrp_cli.cli import main


def brrp(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def red_box(path: Path) -> None:
    box = trimesh.creation.box((0.10, 0.06, 0.04))
    red = np.tile([220, 20, 20, 255], (len(box.vertices), 1))
    trimesh.Trimesh(box.vertices, box.faces, vertex_colors=red, process=False).export(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("group")
    for name in ("a", "b"):
        (folder / name).mkdir()
    red_box(folder / "a/red_box.ply")
    trimesh.creation.icosphere(subdivisions=2, radius=0.04).export(folder / "b/ball.stl")
    out = ("-o", folder / "prior", "--samples", 200, "--workers", 1)
    assert brrp("-q", "build-prior", folder / "a", *out).exit_code == 0
    return folder


def test_add_list_show_remove(folder: Path, tmp_path: Path) -> None:
    prior = ("--prior", folder / "prior")
    added = brrp("prior", "add", folder / "b/ball.stl", "--workers", 1, *prior)
    assert added.exit_code == 0, added.stderr
    assert "1 object made; 2 objects now" in added.stdout
    assert brrp("prior", "list", *prior).stdout == "ball\ta ball\nred_box\ta red box\n"
    shown = brrp("prior", "show", "red_box", *prior, "-o", tmp_path / "box.png")
    assert shown.exit_code == 0, shown.stderr
    assert "a red box" in shown.stdout
    assert "10.0 x 6.0 x 4.0 cm, 240 cm3" in shown.stdout
    # It rests on its largest face more often than on any other.
    poses = [line for line in shown.stdout.splitlines() if "high on" in line]
    assert "4.0 cm high on 10.0 x 6.0 cm" in poses[0]
    picture = np.asarray(Image.open(tmp_path / "box.png")).astype(int)
    red = (picture[..., 0] > 60) & (picture[..., 0] > 4 * picture[..., 1])
    assert 0.2 < red.mean() < 0.8
    assert red[240, 240]
    assert not red[0].any() and not red[:, 0].any()
    again = brrp("prior", "show", "red_box", *prior, "-o", tmp_path / "box.png")
    assert again.exit_code == 1 and "--overwrite" in again.stderr
    assert "red_box" in brrp("prior", "show", "red_bax", *prior).stderr
    for name in ("box.txt", "box.jpg", "box"):
        other = brrp("prior", "show", "red_box", *prior, "-o", tmp_path / name)
        assert other.exit_code == 2 and f"must end in .png, not '{name}'" in other.stderr
        assert not (tmp_path / name).exists()
    removed = brrp("prior", "remove", "ball", *prior)
    assert "1 object removed; 1 object now" in removed.stdout
    assert brrp("prior", "list", *prior).stdout == "red_box\ta red box\n"


def test_only_failures_of_what_is_added_are_told_and_one_can_be_forgotten(
    folder: Path, tmp_path: Path
) -> None:
    prior = ("--prior", shutil.copytree(folder / "prior", tmp_path / "prior"))
    bad = tmp_path / "bad.stl"
    bad.write_text("no mesh")
    broken = brrp("prior", "add", bad, "--workers", 1, *prior)
    assert broken.exit_code == 3 and broken.stderr.count("failed: ") == 1
    added = brrp("prior", "add", folder / "b/ball.stl", "--workers", 1, *prior)
    assert added.exit_code == 0 and "failed" not in added.stderr, added.stderr
    assert "1 object made; 2 objects now" in added.stdout
    again = brrp("prior", "add", bad, "--workers", 1, *prior)
    assert again.exit_code == 3 and again.stderr.count("failed: ") == 1
    gone = brrp("prior", "remove", "bad", *prior)
    assert gone.exit_code == 0 and gone.stdout.startswith("1 failed mesh forgotten; 2 objects now")
    assert "no such object" in brrp("prior", "remove", "bad", *prior).stderr.lower()
    both = brrp("prior", "add", bad, "--workers", 1, *prior)
    assert both.exit_code == 3
    both = brrp("prior", "remove", "bad", "ball", *prior)
    assert both.stdout.startswith("1 object removed, 1 failed mesh forgotten; 1 object now")


def test_merge_tells_what_is_in_the_new_prior(folder: Path, tmp_path: Path) -> None:
    small = ("--samples", 200, "--workers", 1)
    assert brrp("build-prior", folder / "b", "-o", tmp_path / "b", *small).exit_code == 0
    merged = brrp("prior", "merge", folder / "prior", tmp_path / "b", "-o", tmp_path / "both")
    assert merged.exit_code == 0, merged.stderr
    assert "2 priors merged; 2 objects now" in merged.stdout
    both = brrp("build-prior", folder / "a", folder / "b", "-o", tmp_path / "both", *small)
    assert "2 objects (0 made, 2 kept, 0 failed)" in both.stdout
