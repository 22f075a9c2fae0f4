"""`brrp demo` as people run it."""

import json

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from brrp_cli.cli import main
from brrp_cli.demo import scene
from brrp_cli.frames.npz import load_frame


@pytest.fixture
def small(two_shapes, tmp_path, monkeypatch):
    """One object in the scene and two in the prior."""
    monkeypatch.setattr(scene, "household_shapes", lambda: two_shapes)
    monkeypatch.setattr(scene, "STORED", 1)
    monkeypatch.setattr(scene, "VARIED", 0)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_demo_ends_with_scores_and_files(small):
    result = CliRunner().invoke(main, ["demo"])
    assert result.exit_code == 0, result.output
    last = result.output.strip().splitlines()[-1]
    assert last.startswith("Wrote 1 of 1 object")
    assert "brrp_demo/" in last
    out = small / "brrp_demo"
    frame = load_frame(out / "frame.npz")
    assert frame.object_ids == [1]
    truth = trimesh.load(out / "truth" / "object_1.ply")
    found = trimesh.load(out / "result" / "object_1.ply")
    assert np.linalg.norm(truth.bounds.mean(axis=0) - found.bounds.mean(axis=0)) < 0.03
    assert (out / "result" / "preview.png").stat().st_size > 10_000
    assert json.loads((out / "result" / "result.json").read_text())["retriever"] == "appearance"
    row = next(line for line in result.output.splitlines() if line.startswith("  1 "))
    assert row.split()[1] in ("soup_can", "wood_block")
    # What it was taken for, and IoU before the distance and its unit.
    assert row.split()[3] == row.split()[5] == row.split()[1]
    assert 0.7 < float(row.split()[-3]) <= 1.0

    again = CliRunner().invoke(main, ["demo"])
    assert again.exit_code == 1
    assert "--overwrite" in again.output
    assert "Traceback" not in again.output


def test_an_output_that_cannot_be_written_is_told_before_the_work(small):
    (small / "file").write_text("not a folder")
    result = CliRunner().invoke(main, ["demo", "-o", "file/out"])
    assert result.exit_code == 1
    assert "Cannot write" in result.output
    assert "Prior:" not in result.output


@pytest.mark.slow
def test_the_whole_demo(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    result = CliRunner().invoke(main, ["demo", "-o", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    mean = next(line for line in result.output.splitlines() if line.startswith("  mean"))
    assert float(mean.split()[1]) > 0.6
