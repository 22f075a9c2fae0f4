"""--json: what a command reports is one JSON object on stdout, and all else is on stderr."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from made_result import BOX, ELL, write_made_result
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.cli import COMMANDS, main
from brrp_cli.frames.npz import save_frame
from brrp_cli.shapes import solids


def report(*arguments):
    result = CliRunner().invoke(main, [*map(str, arguments), "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout), result.stderr


def test_segment_tells_its_objects_in_metres(tmp_path):
    things = {1: in_camera(solids.moved(solids.box(0.1, 0.06, 0.14), y=0.1), T_CAM_WORLD)}
    save_frame(photograph(things), tmp_path / "f.npz")
    told, notes = report("segment", tmp_path / "f.npz", "-o", tmp_path / "g.npz")
    (item,) = told["objects"]
    assert item["id"] == 1 and item["with_depth"] == 1.0 and not item["new"]
    assert 0.4 < item["distance"] < 1.0 and max(item["extents"]) < 0.2
    assert told["output"] == str(tmp_path / "g.npz") and "Wrote" in notes


def test_export_tells_its_plan(tmp_path):
    folder = write_made_result(tmp_path / "out")
    told, notes = report("export", folder, "--collision", "hull")
    assert {item["id"] for item in told["objects"]} == {BOX, ELL}
    assert told["output"] == str(folder / "plan") and "Wrote collision shapes" in notes


@pytest.mark.parametrize(
    "name", ["reconstruct", "segment", "export", "info", "verify", "demo", "eval"]
)
def test_every_command_that_reports_takes_it(name):
    assert name in COMMANDS
    assert "--json" in CliRunner().invoke(main, [name, "--help"]).output
