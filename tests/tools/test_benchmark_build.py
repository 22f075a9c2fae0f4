"""Building is timed stage by stage and as a whole, and the numbers are kept."""

from __future__ import annotations

import json

import pytest
from benchmark_build import main
from click.testing import CliRunner
from table_scene import box

from brrp_cli.threads import cores


@pytest.mark.slow
def test_a_mesh_is_timed_by_stages_and_a_build_as_a_whole(tmp_path):
    meshes, history = tmp_path / "meshes", tmp_path / "history.jsonl"
    meshes.mkdir()
    box().export(meshes / "box.ply")
    given = [str(meshes), "--stages", "1", "--counts", "1", "--json", str(history)]
    told = CliRunner().invoke(main, given, catch_exceptions=False)
    assert told.exit_code == 0, told.output
    found = json.loads(history.read_text())
    stages = {name: each["median"] for name, each in found["stages"].items()}
    whole = stages.pop("whole")
    # Nothing but sums and names lies between the stages.
    assert 0.8 * whole < sum(stages.values()) <= whole
    assert {"load", "repair", "features", "mesh"} < stages.keys()
    assert {build["workers"] for build in found["builds"]} == {1, cores()}
    assert all(build["meshes"] == 1 and build["megabytes"] > 50 for build in found["builds"])


def test_a_folder_without_meshes_is_one_message(tmp_path):
    told = CliRunner().invoke(main, [str(tmp_path)])
    assert told.exit_code == 1 and "mesh" in told.output
