from pathlib import Path

import numpy as np
import pytest
import trimesh

from brrp_cli.errors import MeshError
from brrp_cli.prior.build.load_mesh import load_mesh

TWO_CHARTS = """v 0 0 0
v .1 0 0
v 0 .1 0
v 0 0 .1
v 0 0 0
v .1 0 0
vt 0 0
vt 1 0
vt 0 1
vn 0 0 1
vn 0 1 0
f 1/1/1 3/2/1 2/3/1
f 5/2/2 6/1/2 4/3/2
f 1/3/1 4/1/2 3/2/1
f 2/1/1 3/3/1 4/2/2
"""


def test_texture_seams_are_merged(tmp_path: Path) -> None:
    path = tmp_path / "tetra.obj"
    path.write_text(TWO_CHARTS)
    mesh = load_mesh(path)
    assert mesh.vertices.shape == (4, 3)
    assert mesh.is_watertight


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".off", ".glb"])
def test_every_format_gives_the_same_box(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"box{suffix}"
    trimesh.creation.box((0.1, 0.2, 0.3)).export(path)
    mesh = load_mesh(path)
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.extents, (0.1, 0.2, 0.3), rtol=1e-6)


def test_scene_transforms_are_applied(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    move = trimesh.transformations.translation_matrix((0.5, 0, 0))
    scene.add_geometry(trimesh.creation.box((0.1, 0.1, 0.1)))
    scene.add_geometry(trimesh.creation.box((0.1, 0.1, 0.1)), transform=move)
    scene.export(tmp_path / "two.glb")
    np.testing.assert_allclose(load_mesh(tmp_path / "two.glb").extents, (0.6, 0.1, 0.1), rtol=1e-6)


def test_millimetres_are_refused_with_the_option_that_reads_them(tmp_path: Path) -> None:
    path = tmp_path / "box.stl"
    trimesh.creation.box((100, 60, 40)).export(path)
    with pytest.raises(MeshError, match="--units mm"):
        load_mesh(path)
    np.testing.assert_allclose(load_mesh(path, "mm").extents, (0.1, 0.06, 0.04))
    np.testing.assert_allclose(load_mesh(path, "cm").extents, (1.0, 0.6, 0.4))


CORNERS = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "read|no faces"),
        (CORNERS, "read|no faces"),
        (CORNERS + "f 1 2 9\n", "read|not there"),
        (CORNERS + "v nan 0 0\nf 1 2 5\nf 1 2 3\n", "NaN"),
        (CORNERS + "v inf 0 0\nf 1 2 5\nf 1 2 3\n", "NaN or infinite"),
        (CORNERS + "f 1 2 3\n", "flat"),
        ("v 0 0 0\nv 1e-6 0 0\nv 0 1e-6 0\nv 0 0 1e-6\nf 1 2 3\nf 1 2 4\n", "too small"),
        ("\x00\x01 junk", "read|no faces"),
    ],
)
def test_bad_files_are_refused_with_a_reason(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "bad.obj"
    path.write_text(text)
    with pytest.raises(MeshError, match=told) as caught:
        load_mesh(path)
    assert caught.value.where == path


@pytest.mark.parametrize("data", [b"glTF" + bytes(range(256)), b"{", b""])
def test_why_a_glb_cannot_be_read_is_told_in_words(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "bad.glb").write_bytes(data)
    with pytest.raises(MeshError, match="cannot be read") as caught:
        load_mesh(tmp_path / "bad.glb")
    assert caught.value.found == "bytes that are no such mesh"
    assert caught.value.expected == "a whole GLB file" and "export it again" in caught.value.fix


def test_what_is_too_small_by_its_unit_is_refused_with_the_option(tmp_path: Path) -> None:
    trimesh.creation.box((0.05, 0.05, 0.05)).export(tmp_path / "box.stl")
    with pytest.raises(MeshError, match=r"too small(.|\n)*pass --units m$"):
        load_mesh(tmp_path / "box.stl", "mm")


def test_flat_in_a_tilted_plane_is_refused(tmp_path: Path) -> None:
    sheet = trimesh.creation.box((0.1, 0.1, 0.0))
    sheet.apply_transform(trimesh.transformations.rotation_matrix(0.7, (1, 2, 3)))
    sheet.export(tmp_path / "sheet.ply")
    with pytest.raises(MeshError, match="flat"):
        load_mesh(tmp_path / "sheet.ply")
