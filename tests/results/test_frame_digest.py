"""Two frames have one digest if, and only if, all that is reconstructed of them is the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import load_frame, save_frame
from brrp_cli.results.frame_digest import frame_digest
from brrp_cli.shapes import solids


@pytest.fixture(scope="module")
def frame() -> Frame:
    return photograph({1: in_camera(solids.box(0.07, 0.07, 0.1), T_CAM_WORLD)})


def test_the_same_arrays_have_one_digest_wherever_they_lie(frame, tmp_path):
    save_frame(frame, tmp_path / "a.npz")
    read = load_frame(tmp_path / "a.npz")
    assert frame_digest(read) == frame_digest(frame)
    assert frame_digest(replace(frame, source=Path("elsewhere"))) == frame_digest(frame)


def test_each_part_of_a_frame_counts(frame):
    rgb = frame.rgb.copy()
    rgb[3, 4, 0] ^= 1
    points = frame.points.copy()
    points[frame.valid] *= np.float32(1.001)
    aside = np.zeros_like(frame.segmap)
    others = {
        "rgb": replace(frame, rgb=rgb),
        "points": replace(frame, points=points),
        "K": replace(frame, K=frame.K * [[1.001], [1], [1]]),
        "pose": replace(frame, T_world_cam=np.diag([1.0, -1, -1, 1])),
        "masks": frame.with_masks(np.where(frame.segmap == 1, 2, 0)),
        "left out": frame.with_masks(frame.segmap, aside),
        "corrected": frame.with_masks(frame.segmap, aside, frozenset({1})),
    }
    digests = {frame_digest(each) for each in [frame, *others.values()]}
    assert len(digests) == 1 + len(others)
