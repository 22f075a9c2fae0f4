"""Results whose frame was corrected since: nobody reads one with the other."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from made_result import write_made_result

from brrp_cli.api import open_result
from brrp_cli.cli import main
from brrp_cli.errors import ResultError
from brrp_cli.frames.npz import load_frame, save_frame


@pytest.fixture
def folder(tmp_path):
    return write_made_result(tmp_path / "out")


def test_results_of_the_frame_beside_them_are_read(folder):
    assert open_result(folder).frame.object_ids


@pytest.mark.parametrize("correction", [["--drop", 7], ["--merge", "40,7"], ["--split", 7]])
@pytest.mark.parametrize("command", [["grasp"], ["export", "--collision", "hull"], ["view"]])
def test_after_a_correction_it_is_to_be_reconstructed(folder, correction, command):
    path = folder / "frame.npz"
    segment = ["segment", path, *correction, "-o", path, "--overwrite"]
    corrected = CliRunner().invoke(main, list(map(str, segment)))
    assert corrected.exit_code == 0, corrected.output
    assert "results beside it are of the masks before" in corrected.stderr
    result = CliRunner().invoke(main, [*command, str(folder)])
    assert result.exit_code == 1 and isinstance(result.exception, SystemExit)
    assert "other masks" in result.output and f"brrp reconstruct {path} -o NEW/" in result.output


def test_a_new_object_beside_the_others_changes_none_of_them(folder):
    frame = load_frame(folder / "frame.npz")
    segmap = frame.segmap.copy()
    free = np.argwhere((segmap == 0) & frame.valid)[:50]
    segmap[tuple(free.T)] = 77
    save_frame(frame.with_masks(segmap), folder / "frame.npz")
    assert 77 in open_result(folder).frame.object_ids


def test_masks_that_are_gone_are_named(folder):
    frame = load_frame(folder / "frame.npz")
    save_frame(frame.with_masks(np.where(frame.segmap == 7, 0, frame.segmap)), folder / "frame.npz")
    with pytest.raises(ResultError, match="other masks of the objects 7"):
        _ = open_result(folder).frame


def test_what_a_session_kept_from_an_earlier_frame_is_read_with_the_newest(folder):
    frame = load_frame(folder / "frame.npz")
    rng = np.random.default_rng(0)
    gone = (frame.segmap == 7) & (rng.random(frame.shape) < 0.1)
    points = np.where(gone[..., None], np.float32(np.nan), frame.points)
    save_frame(frame.with_points(points), folder / "frame.npz")
    assert open_result(folder).frame.object_points(7).size
