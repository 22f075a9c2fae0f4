"""The soak tool on a few frames, and its judgement on memory that grows."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from table_scene import MESHES, photograph, placed

import brrp_cli
from brrp_cli.frames.npz import save_frame

ROOT = Path(brrp_cli.__file__).parents[1]


@pytest.fixture
def is_flat(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "tools"))
    import soak

    return soak.is_flat


def test_growth_is_told_from_what_is_loaded_once(is_flat) -> None:
    assert is_flat([300, 700, 705, 700, 704, 703, 702, 706])
    assert is_flat([700 + 10 * (i % 3) for i in range(40)])
    assert not is_flat([500 + 3 * i for i in range(80)])
    assert not is_flat([100.0] * 20 + [150.0] * 20)


@pytest.mark.long
def test_memory_is_flat_over_frames(tmp_path: Path) -> None:
    mesh = MESHES["box"]().copy().apply_transform(placed(0.0, 0.0, 0.5))
    save_frame(photograph({1: mesh}), tmp_path / "frame.npz")
    command = [sys.executable, "tools/soak.py", tmp_path / "frame.npz", "--frames", "60"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert re.search(r"60 frames in one process, ok: [0-9.]+ MB", result.stdout)
