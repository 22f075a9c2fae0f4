from pathlib import Path

import pytest

from brrp_cli.errors import MeshError
from brrp_cli.prior.build.find_meshes import find_all_meshes, find_meshes


def touch(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("")


def test_ycb_tree_takes_the_folders_name(tmp_path: Path) -> None:
    touch(tmp_path / "003_cracker_box/google_16k/textured.obj")
    touch(tmp_path / "003_cracker_box/tsdf/textured.obj")
    touch(tmp_path / "065-a_cups/tsdf/textured.obj")
    touch(tmp_path / "notes/readme.txt")
    found = find_meshes(tmp_path)
    assert [(s.name, s.relative) for s in found] == [
        ("003_cracker_box", "003_cracker_box/google_16k/textured.obj"),
        ("065-a_cups", "065-a_cups/tsdf/textured.obj"),
    ]


def test_flat_folder_of_every_format_in_order(tmp_path: Path) -> None:
    for name in ("e.obj", "d.PLY", "c.stl", "b.off", "a.glb", "f.mtl", ".hidden.obj"):
        touch(tmp_path / name)
    assert [s.name for s in find_meshes(tmp_path)] == ["a", "b", "c", "d", "e"]


def test_names_are_safe_in_file_systems(tmp_path: Path) -> None:
    touch(tmp_path / "my cup (blue)!.obj")
    assert find_meshes(tmp_path)[0].name == "my_cup_blue"


@pytest.mark.parametrize("other", ["cup.ply", "CUP.obj", "cup/google_16k/textured.obj"])
def test_two_meshes_of_one_name_are_refused_by_name(tmp_path: Path, other: str) -> None:
    touch(tmp_path / "cup.stl")
    touch(tmp_path / other)
    with pytest.raises(MeshError, match="one name") as caught:
        find_meshes(tmp_path)
    assert "cup.stl" in str(caught.value)
    assert other in str(caught.value)


def test_nothing_found_tells_what_is_there_and_what_would_do(tmp_path: Path) -> None:
    touch(tmp_path / "cup.blend")
    with pytest.raises(MeshError) as caught:
        find_meshes(tmp_path)
    assert "cup.blend" in str(caught.value)
    assert ".glb" in str(caught.value)
    with pytest.raises(MeshError, match="no such folder") as caught:
        find_meshes(tmp_path / "absent")
    assert caught.value.fix
    with pytest.raises(MeshError, match=r"no mesh of a known format(.|\n)*\.blend(.|\n)*export"):
        find_all_meshes([tmp_path / "cup.blend"])


def test_a_folder_without_meshes_names_the_one_inside_that_holds_them(tmp_path: Path) -> None:
    touch(tmp_path / "notes/a.txt")
    touch(tmp_path / "sub/deep/cup.ply")
    with pytest.raises(MeshError, match=f"name the folder that holds them: {tmp_path / 'sub'}"):
        find_meshes(tmp_path)


def test_meshes_deeper_in_a_folder_are_noted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for file in ("cup.stl", "sub/bowl.ply", "more/deep/can.OBJ", "notes/a.txt", ".git/b.obj"):
        touch(tmp_path / file)
    touch(tmp_path / "025_mug/google_16k/textured.obj")
    assert [s.name for s in find_all_meshes([tmp_path])] == ["025_mug", "cup"]
    assert "left out: more, sub." in caplog.text
    caplog.clear()
    places = [tmp_path, tmp_path / "sub", tmp_path / "more" / "deep"]
    assert [s.name for s in find_all_meshes(places)] == ["025_mug", "bowl", "can", "cup"]
    find_all_meshes([tmp_path / "025_mug"])
    assert not caplog.text
