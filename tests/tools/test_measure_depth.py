"""What the table says of depth whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest
from made_scenes import generate, write_two
from measure_depth import Errors, add
from scipy.ndimage import uniform_filter

from brrp_cli.frames.npz import save_frame
from brrp_cli.ground_truth.scenes import find_scenes


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    data = write_two(tmp_path_factory.mktemp("depth"))
    options = "--scenes 1 --views 1 --size 640x480 --noise none --seed 2"
    result = generate(data, data / "scenes", *options.split())
    assert result.exit_code == 0, result.output
    return data


def told(folder, data):
    (scene,) = find_scenes(folder)
    errors = Errors()
    add(errors, scene, data)
    return errors


def test_depth_without_errors_is_used_as_it_is(made):
    errors = told(made / "scenes", made)
    assert (errors.smooths, errors.mixes, errors.before) == ([0.0], [0], [])
    assert np.concatenate(errors.kept).max() < 0.001
    assert not len(np.concatenate(errors.left))


def test_what_a_camera_mixes_is_left_out(made):
    (scene,) = find_scenes(made / "scenes")
    frame = scene.view(0)
    depth = frame.depth.astype(np.float64)
    mean = uniform_filter(np.nan_to_num(depth, nan=float(np.nanmax(depth))), 5)
    mixed = frame.with_points((frame.points * (mean / depth)[..., None]).astype(np.float32))
    folder = made / "mixed"
    folder.mkdir()
    save_frame(mixed, folder / "0.npz")
    truth = made / "scenes" / scene.name / "objects.json"
    (folder / "0.truth.json").write_text(truth.read_text())
    errors = told(folder, made)
    assert errors.mixes == [2]
    left, kept = np.concatenate(errors.left), np.concatenate(errors.kept)
    assert left.mean() > 10 * kept.mean()
    assert len(left) < 0.2 * len(kept)
    assert errors.row("mixed").startswith("| mixed | 0 (0 to 0) | 0, - to - mm | 2 (2 to 2) |")
