"""`brrp fetch ycb` and `household` from a server of small files, and the manifests themselves."""

from __future__ import annotations

import hashlib
import io
import tarfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from serving import Plan, serving

from brrp_cli.cli import main
from brrp_cli.fetch import download, meshes
from brrp_cli.fetch.meshes import read_mesh_set

OBJ = np.random.default_rng(0).bytes(400_000)
MTL = b"map_Kd texture_map.jpg \n"
MTL_PNG = b"map_Kd texture_map.png \n"
JPG = b"\xff\xd8 a picture"
PNG = b"\x89PNG\r\n\x1a\n the same picture"
MUG = "025_mug/google_16k"
ARCHIVE = "data/google/025_mug_google_16k.tgz"
FILES = {f"{MUG}/textured.obj": OBJ, f"{MUG}/textured.mtl": MTL, f"{MUG}/texture_map.jpg": JPG}
AS_PNG = {**FILES, f"{MUG}/textured.mtl": MTL_PNG, f"{MUG}/texture_map.png": PNG}
del AS_PNG[f"{MUG}/texture_map.jpg"]


def entry(path: str, data: bytes) -> str:
    sha256 = hashlib.sha256(data).hexdigest()
    return f'{{ path = "{path}", bytes = {len(data)}, sha256 = "{sha256}" }}'


def archive(files: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as tar:
        for path, data in {**files, f"{MUG}/kinbody.xml": b"<KinBody/>"}.items():
            info = tarfile.TarInfo(path)
            info.size = len(data)
            tar.addfile(info, io.BytesIO(data))
    return stream.getvalue()


@pytest.fixture(autouse=True)
def manifests(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "manifests"
    folder.mkdir()
    (folder / "ycb_meshes.toml").write_text(
        'title = "YCB"\nlicence = "CC BY 4.0"\naddress = "http://127.0.0.1:9"\n'
        'archive = "data/google/{name}_google_16k.tgz"\n'
        f"files = [{', '.join(entry(path, data) for path, data in FILES.items())}]\n"
        f'[[instead]]\npath = "textured.mtl"\nby = {entry("textured.mtl", MTL_PNG)}\n'
        '[[instead]]\npath = "texture_map.jpg"\nby = { path = "texture_map.png" }\n'
    )
    (folder / "household_meshes.toml").write_text(
        'title = "Household"\nlicence = "CC0"\naddress = "http://127.0.0.1:9"\n'
        'remote = "models/{stem}/{path}"\n'
        f"files = [{entry('anvil.glb', OBJ)}, {entry('cup.glb', JPG)}]\n"
    )
    monkeypatch.setattr(meshes, "FOLDER", folder)
    monkeypatch.setattr(download, "PAUSE", 0)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


def brrp_fetch(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["fetch", *map(str, arguments)])


def held(folder: Path) -> dict[str, bytes]:
    files = (p for p in folder.rglob("*") if p.is_file() and p.name != ".lock")
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


def test_household_lies_flat_in_the_users_data_folder(tmp_path: Path) -> None:
    plan = Plan({"models/anvil/anvil.glb": OBJ, "models/cup/cup.glb": JPG}, cuts=[2**17])
    with serving(plan) as address:
        first = brrp_fetch("household", "--from", address)
        again = brrp_fetch("household", "--from", address)
    assert first.exit_code == 0, first.stderr
    assert held(tmp_path / "data/brrp/meshes/household") == {"anvil.glb": OBJ, "cup.glb": JPG}
    assert "2 files fetched, 0 there already" in first.stdout
    assert "0 files fetched, 2 there already" in again.stdout
    assert plan.asked == [None, f"bytes={2**17}-", None]


@pytest.mark.parametrize("layout", ["{name}.glb", "models/{name}/{name}.glb"])
def test_household_from_a_folder_in_either_layout(tmp_path: Path, layout: str) -> None:
    for name, data in (("anvil", OBJ), ("cup", JPG)):
        path = tmp_path / "stick" / layout.format(name=name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    out = tmp_path / "out"
    assert brrp_fetch("household", "--from", tmp_path / "stick", "-o", out).exit_code == 0
    assert held(out) == {"anvil.glb": OBJ, "cup.glb": JPG}


def test_ycb_comes_out_of_archives_and_goes_on_after_a_cut(tmp_path: Path) -> None:
    packed = archive(FILES)
    half = 4 * download.CHUNK
    plan = Plan({ARCHIVE: packed}, cuts=[len(packed), half, 0, 0, 0])
    out = tmp_path / "ycb"
    with serving(plan) as address:
        cut = brrp_fetch("ycb", "--from", address, "-o", out)
        assert cut.exit_code == 1
        assert "run the same command again" in cut.stderr
        assert [path for path in held(out) if not path.endswith(".part")] == []
        plan.cuts.clear()
        whole = brrp_fetch("ycb", "--from", address, "-o", out)
        assert whole.exit_code == 0, whole.stderr
        again = brrp_fetch("ycb", "--from", address, "-o", out)
    assert held(out) == FILES
    assert f"bytes={half}-" in plan.asked
    assert "0 files fetched, 3 there already, all checked" in again.stdout


def test_ycb_with_a_png_says_what_is_not_checked(tmp_path: Path) -> None:
    out = tmp_path / "ycb"
    with serving(Plan({ARCHIVE: archive(AS_PNG)})) as address:
        result = brrp_fetch("ycb", "--from", address, "-o", out)
        again = brrp_fetch("ycb", "--from", address, "-o", out)
    assert result.exit_code == 0, result.stderr
    assert held(out) == AS_PNG
    assert "1 texture has no known sum and was taken unchecked" in result.stderr
    assert "0 files fetched" in again.stdout


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (archive({**FILES, f"{MUG}/textured.obj": OBJ[:-1] + b"?"}), "not the one that was asked"),
        (archive({**FILES, f"{MUG}/textured.obj": OBJ + b"?"}), "another file than the one"),
        (archive({**AS_PNG, f"{MUG}/texture_map.png": JPG}), "no PNG"),
        (archive({f"{MUG}/textured.obj": OBJ}), "lacks a file"),
        (archive(FILES)[:-300], "cannot be read"),
        (b"<html>log in</html>", "cannot be read"),
    ],
)
def test_an_archive_of_other_things_is_refused(tmp_path: Path, data: bytes, told: str) -> None:
    out = tmp_path / "ycb"
    with serving(Plan({ARCHIVE: data})) as address:
        result = brrp_fetch("ycb", "--from", address, "-o", out)
    assert result.exit_code == 1
    assert told in result.stderr
    # What came out before the fault is right; nothing half written is left.
    assert held(out).items() <= {**AS_PNG, **FILES}.items() | AS_PNG.items()


@pytest.mark.parametrize("place", [ARCHIVE, Path(ARCHIVE).name])
def test_ycb_from_a_folder_of_archives(tmp_path: Path, place: str) -> None:
    path = tmp_path / "stick" / place
    path.parent.mkdir(parents=True)
    path.write_bytes(archive(FILES))
    out = tmp_path / "ycb"
    assert brrp_fetch("ycb", "--from", tmp_path / "stick", "-o", out).exit_code == 0
    assert held(out) == FILES
    assert path.is_file()


def test_options_of_models_are_not_those_of_meshes(tmp_path: Path) -> None:
    assert brrp_fetch("clip", "-o", tmp_path).exit_code == 2
    assert brrp_fetch("ycb", "--precision", "8bit").exit_code == 2
    assert brrp_fetch("household", "--clip-dir", tmp_path).exit_code == 2


@pytest.mark.parametrize(("name", "count"), [("ycb", 171), ("household", 224)])
def test_the_manifests_of_the_package(
    name: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    found = read_mesh_set(name)
    assert len({file.path for file in found.files}) == count
    assert all(len(file.sha256) == 64 and file.bytes > 0 for file in found.files)
    if name == "household":
        anvil = next(file for file in found.files if file.path == "anvil.glb")
        assert anvil.remote == "models/anvil/anvil.glb"
