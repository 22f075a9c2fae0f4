"""What is counted of a frame that was changed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from measure_conditions import CONDITIONS, Counts, add, matched

from brrp_cli.frames.build import make_frame
from brrp_cli.frames.npz import save_frame
from brrp_cli.geometry import backproject

TOOL = Path(__file__).resolve().parents[2] / "tools" / "measure_conditions.py"


@pytest.fixture(scope="module")
def frame(scene):
    return make_frame(rgb=scene.rgb, segmap=scene.segmap, depth=scene.depth, K=scene.K)


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_changed_frame_shows_the_same_things_at_the_same_pixels(frame, name):
    condition = CONDITIONS[name]
    changed = condition.made(frame)
    assert not changed.object_ids
    np.testing.assert_allclose(
        changed.points, backproject(changed.depth, changed.K), atol=1e-4, equal_nan=True
    )
    back = condition.back(np.nan_to_num(changed.depth))
    off = np.abs(back - np.nan_to_num(frame.depth))[back > 0]
    assert np.median(off) < 0.01
    assert back.shape == frame.shape


@pytest.mark.parametrize("name", ["rolled_20", "rolled_45"])
def test_what_a_rolled_camera_sees_is_as_far_from_it(scene, name):
    K = scene.K + np.array([[0, 0, 30], [0, 0, -20], [0, 0, 0]])
    frame, condition = make_frame(rgb=scene.rgb, depth=scene.depth, K=K), CONDITIONS[name]
    far = np.linalg.norm(frame.points, axis=-1)
    back = condition.back(np.nan_to_num(np.linalg.norm(condition.made(frame).points, axis=-1)))
    seen = (back > 0) & np.isfinite(far)
    assert np.median(np.abs(back - far)[seen]) < 0.001


def test_masks_match_one_to_one():
    masks = np.zeros((20, 40), np.int64)
    masks[:10, :10], masks[:10, 20:30] = 1, 2
    assert matched(masks, masks) == 2
    moved = np.where(masks == 1, 5, 0) + np.where(np.roll(masks, 3, axis=1) == 2, 6, 0)
    assert matched(masks, moved) == 1, "the other one overlaps by half"
    assert matched(masks, np.zeros_like(masks)) == 0


def test_what_stays_the_same_is_counted(frame):
    counts = {name: Counts() for name in ("quarter", "upside_down", "no_edges")}
    add(counts, frame, None)
    assert counts["quarter"] == Counts(same=3, masks=3, made=3)
    assert counts["upside_down"] == Counts(same=3, masks=3, made=3)


def test_the_command_prints_a_row_for_each_condition(frame, tmp_path):
    save_frame(frame, tmp_path / "frame.npz")
    run = [sys.executable, str(TOOL), str(tmp_path / "frame.npz"), "--only"]
    done = subprocess.run([*run, "quarter,dark"], capture_output=True, text=True, check=True)
    assert [line.split(" | ")[0] for line in done.stdout.splitlines()[2:]] == [
        "| quarter",
        "| dark",
    ]
    assert "3 of 3" in done.stdout
    wrong = subprocess.run([*run, "rain"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2 and "not rain" in wrong.stderr
