import json
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner, Result

from brrp_cli.cli import main


def brrp(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    folder = tmp_path_factory.mktemp("commands")
    tree = folder / "ycb/025_mug/google_16k"
    tree.mkdir(parents=True)
    trimesh.creation.cylinder(radius=0.04, height=0.09).export(tree / "textured.obj")
    trimesh.creation.box((100, 60, 40)).export(folder / "ycb/big_block.stl")
    result = brrp(
        *("-q", "build-prior", folder / "ycb", "-o", folder / "prior"),
        *("--samples", 200, "--workers", 1),
    )
    return folder / "prior", result


def test_build_says_what_failed_and_what_was_written(built: tuple[Path, Result]) -> None:
    folder, result = built
    assert result.exit_code == 3
    assert "big_block.stl" in result.stderr
    assert "--units mm" in result.stderr
    last = result.stdout.splitlines()[-1]
    assert last.startswith("1 object (1 made, 0 kept, 1 failed)")
    assert str(folder) in last


def test_info_as_table_and_as_json(built: tuple[Path, Result]) -> None:
    folder, _ = built
    table = brrp("info", folder).stdout
    assert "025_mug" in table
    assert "a dark red mug with a handle" in table
    assert "8.0 x 8.0 x 9.0" in table
    assert "big_block.stl" in table
    values = json.loads(brrp("info", folder, "--json").stdout)
    assert values["parameters"]["samples"] == 200
    assert values["objects"][0]["record"]["repair"]["closed_before"] is True
    assert len(values["digest"]) == 64


def test_verify_passes_then_lists_the_damage(built: tuple[Path, Result]) -> None:
    folder, _ = built
    assert brrp("verify", folder).exit_code == 0
    shard = next((folder / "shards").iterdir())
    whole = shard.read_bytes()
    shard.write_bytes(whole[:1000])
    result = brrp("verify", folder)
    shard.write_bytes(whole)
    assert result.exit_code == 1
    assert f"1000 bytes in place of {len(whole)}" in result.stdout
    assert ", 1 problem\n" in result.stdout


def test_the_prior_is_found_through_the_environment(
    built: tuple[Path, Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BRRP_PRIOR", str(built[0]))
    result = brrp("verify")
    assert result.exit_code == 0
    assert "BRRP_PRIOR" in result.stdout


@pytest.mark.parametrize("command", ["build-prior", "info", "verify"])
def test_help_has_an_example(command: str) -> None:
    result = brrp(command, "--help")
    assert result.exit_code == 0
    assert f"brrp {command}" in result.stdout.split("Example:")[1]


def test_no_meshes_is_one_message(tmp_path: Path) -> None:
    result = brrp("build-prior", tmp_path, "-o", tmp_path / "prior")
    assert result.exit_code == 1
    assert "No meshes found" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_folder_that_cannot_be_written_is_one_message(tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    (tmp_path / "file").write_text("")
    result = brrp("build-prior", tmp_path, "-o", tmp_path / "file" / "prior")
    assert result.exit_code == 1
    assert "Cannot write" in result.stderr


def test_meshes_and_descriptions_that_were_left_out_are_noted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "nest" / "sub").mkdir(parents=True)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "nest" / "box.stl")
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "nest" / "sub" / "other.stl")
    (tmp_path / "d.csv").write_text("boxx,a box\n")
    result = brrp(
        *("build-prior", tmp_path / "nest", "-o", tmp_path / "prior", "--samples", 100),
        *("--workers", 1, "--descriptions", tmp_path / "d.csv"),
    )
    assert result.exit_code == 0, result.output
    assert "meshes in its folders are left out: sub" in caplog.text
    assert "none of the meshes: boxx (is boxx box?)" in caplog.text
