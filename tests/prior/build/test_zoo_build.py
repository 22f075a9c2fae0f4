"""A folder with every fault that people's meshes have: none of them stops the batch."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_zoo import ball_with_small_hole, bowl_sheet, box, moved_box
from PIL import Image
from test_build_faults import TINY

from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.build.mesh_files import input_sha256
from brrp_cli.prior.store import open_prior, verify_prior

CORNERS = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\n"


def write_zoo(folder: Path) -> None:
    """Good, mendable, hopeless."""
    box().export(folder / "good.ply")
    upside_down = box()
    upside_down.invert()
    upside_down.export(folder / "inverted.ply")
    ball_with_small_hole().export(folder / "hole.ply")
    bowl_sheet().export(folder / "open.ply")
    moved_box(5e5, -4e6, 30).export(folder / "far_away.ply")
    joined = trimesh.util.concatenate([box(), moved_box(0.10, 0.06, 0.0)])
    joined.merge_vertices()
    joined.export(folder / "non_manifold.ply")
    (folder / "empty.obj").write_text("")
    (folder / "one_triangle.obj").write_text(CORNERS + "f 1 2 3\n")
    (folder / "nan.obj").write_text(CORNERS + "v nan 0 0\nf 1 2 5\nf 1 2 3\nf 2 3 4\n")
    (folder / "out_of_range.obj").write_text(CORNERS + "f 1 2 9\n")
    trimesh.creation.box((100, 60, 40)).export(folder / "millimetres.stl")
    (folder / "junk.glb").write_bytes(b"glTF" + bytes(range(256)))
    (folder / "gone.ply").symlink_to(folder / "nowhere.ply")
    os.mkfifo(folder / "pipe.ply")
    (folder / "folder.obj").mkdir()


def test_the_zoo_is_built_but_for_what_is_hopeless(tmp_path: Path) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    write_zoo(folder)
    report = build_prior(folder, tmp_path / "prior", TINY, workers=2)
    reasons = {failure.name: failure.reason for failure in report.manifest.failed}
    assert {
        "empty",
        "one_triangle",
        "nan",
        "out_of_range",
        "millimetres",
        "junk",
        "gone",
        "pipe",
    } == (set(reasons) - {"far_away"})
    assert {"good", "inverted", "hole", "open", "non_manifold"} <= set(report.made)
    assert "is no file" in reasons["pipe"] and "cannot be read" in reasons["gone"]
    prior = open_prior(tmp_path / "prior")
    assert verify_prior(prior) == []
    for name in prior.names:
        stored = prior.load(name)
        assert np.isfinite(stored.center).all() and 0 < stored.half_extent < 1
        assert 0 < stored.labels.mean() < 0.9


@pytest.mark.long
def test_a_mesh_of_a_million_faces_is_built(tmp_path: Path) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    fine = trimesh.creation.icosphere(subdivisions=8, radius=0.05)
    assert len(fine.faces) > 1_000_000
    fine.export(folder / "fine.ply")
    box().export(folder / "good.ply")
    report = build_prior(folder, tmp_path / "prior", TINY, workers=1)
    assert report.made == ["fine", "good"]


def textured(folder: Path, colour: tuple[int, int, int]) -> Path:
    """An OBJ with a material file and a texture."""
    Image.new("RGB", (8, 8), colour).save(folder / "skin.png")
    (folder / "skin.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd skin.png\n")
    faces = "f 1/1 3/3 2/2\nf 1/1 2/2 4/3\nf 1/1 4/2 3/3\nf 2/1 3/2 4/3\n"
    text = "mtllib skin.mtl\n" + CORNERS + "vt 0 0\nvt 1 0\nvt 0 1\nusemtl skin\n" + faces
    (folder / "corner.obj").write_text(text)
    return folder / "corner.obj"


def test_a_changed_texture_is_a_changed_mesh(tmp_path: Path) -> None:
    path = textured(tmp_path, (200, 30, 30))
    red = input_sha256(path)
    assert input_sha256(path) == red
    textured(tmp_path, (30, 30, 200))
    blue = input_sha256(path)
    assert blue != red
    (tmp_path / "skin.png").unlink()
    bare = input_sha256(path)
    assert len({red, blue, bare}) == 3
    (tmp_path / "skin.mtl").write_text("newmtl skin\nKd 1 0 0\n")
    assert input_sha256(path) != bare


@pytest.mark.slow
def test_a_changed_texture_makes_its_object_anew_and_no_other(tmp_path: Path) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    textured(folder, (200, 30, 30))
    box().export(folder / "good.ply")
    build_prior(folder, tmp_path / "prior", TINY, workers=1)
    before = open_prior(tmp_path / "prior").load("corner").appearance
    assert build_prior(folder, tmp_path / "prior", TINY, workers=1).made == []
    textured(folder, (30, 30, 200))
    report = build_prior(folder, tmp_path / "prior", TINY, workers=1)
    assert (report.made, report.kept) == (["corner"], ["good"])
    after = open_prior(tmp_path / "prior").load("corner").appearance
    assert not np.array_equal(before.colour, after.colour)
