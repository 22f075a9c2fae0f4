"""The tool from scenes to rows: what was carried out is not carried out again."""

from __future__ import annotations

import json

import numpy as np
import pytest
import tiny_scenes
import trimesh
from click.testing import CliRunner
from tiny_scenes import write_meshes, write_scene

pytest.importorskip("mujoco")
import grasp_experiment

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.physics import GRAVITY


def rows_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_grasps_of_a_block_hold_and_methods_may_come_later(tmp_path, monkeypatch):
    block = trimesh.creation.box((0.05, 0.05, 0.12)).apply_translation([0, 0, 0.06])
    monkeypatch.setitem(tiny_scenes.MESHES, "block", block)
    write_meshes(tmp_path / "shapes")
    write_scene(tmp_path / "scenes" / "a", {4: ("block", 0.0, 0.0)})
    # The camera of these scenes has few pixels.
    monkeypatch.setattr(grasp_experiment, "MIN_PIXELS", 20)
    output = tmp_path / "grasps.jsonl"

    def run(methods):
        given = [f"made={tmp_path / 'scenes'}", "--data-root", tmp_path, "--cache", tmp_path / "c"]
        given += ["--methods", methods, "-o", output]
        result = CliRunner().invoke(grasp_experiment.main, [*map(str, given)])
        assert result.exit_code == 0, result.output
        return result.stdout

    told = run("true mesh")
    first = rows_of(output)
    assert [row["rank"] for row in first] == [1, 2, 3]
    # Sure but for the weight: 150 g, held 3 cm from the middle at most.
    least = np.exp(-0.15 * GRAVITY * 0.03 / GraspConfig.torque)
    assert all(row["result"] == "held" and least < row["score"] <= 1 for row in first)
    assert "| true mesh | made | 100%, 3 | 100%, 1 | 100%, 1 |" in told
    run("true mesh,seen hull,pointsdf")
    assert rows_of(output)[:3] == first
    # PointSDF has weights of its own.
    assert {row["method"] for row in rows_of(output)[3:]} == {"seen hull", "pointsdf"}
    given = ["made=scenes", "--methods", "pointnet", "-o", str(output)]
    refused = CliRunner().invoke(grasp_experiment.main, given)
    assert refused.exit_code == 2 and "--methods of default" in refused.output
