import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pybullet")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from sensor_statistics import COLUMNS, statistics
from tabletop.depth_statistics import quantisation_step, silhouettes, table_residual, waves_and_fine

from brrp_cli.depth_noise.waves import waves
from brrp_cli.frames.build import make_frame

SHAPE = (240, 320)
K = np.array([[300.0, 0, 159.5], [0, 300.0, 119.5], [0, 0, 1]])


def tilted_table():
    """Depth of a plane 0.5 m below the camera, which looks down by 45 degrees."""
    y = (np.arange(SHAPE[0]) - K[1, 2]) / K[1, 1]
    depth = 0.5 / (np.sin(np.pi / 4) + y * np.cos(np.pi / 4))
    return np.repeat(depth[:, None], SHAPE[1], axis=1)


def test_waves_and_fine_noise_are_told_apart():
    rng = np.random.default_rng(0)
    slow, fast = 0.002 * waves(SHAPE, 20.0, rng), 0.0008 * rng.standard_normal(SHAPE)
    found = waves_and_fine(slow + fast, np.ones(SHAPE, dtype=bool))
    assert found == pytest.approx((slow.std(), 0.0008), rel=0.1)


def test_the_tables_residual_is_what_was_added():
    rng = np.random.default_rng(1)
    noise = 0.002 * waves(SHAPE, 15.0, rng)
    found = table_residual(tilted_table() + noise, K)
    assert found.table.mean() > 0.8
    rest = (found.residual - noise)[found.table]
    assert rest.std() < 0.0005
    assert found.region.mean() > 0.9


def test_silhouettes_count_flying_and_missing_pixels_by_side():
    residual = np.zeros((100, 120))
    residual[30:70, 40:80] = -0.1
    residual[30:70, 36:40] = np.nan
    residual[30:70, 80:82] = -0.04
    found = silhouettes(residual)
    assert found.holes_left == pytest.approx(4)
    assert found.holes_right == 0
    # 40 rows from the left without, 40 from the right with two, 42 columns from the top, of which
    # those two do not rise far enough.
    assert found.flying == pytest.approx(80 / 120)
    assert found.count == 120


def test_steps_are_given_at_one_metre():
    disparity = np.arange(200, 400) / 16
    depth = 40.0 / disparity
    assert quantisation_step(depth, depth > 0) == pytest.approx(1 / (16 * 40), rel=0.01)


def test_statistics_of_a_frame_name_every_column():
    depth = tilted_table()
    depth[60:160, 120:200] = 0.45
    depth[100:110, 20:30] = 0
    frame = make_frame(segmap=(depth == 0.45).astype(int), depth=depth, K=K)
    found = statistics(frame)
    assert tuple(found) == COLUMNS
    assert found["waves"] < 0.5
    assert found["face waves"] < 0.1
    assert 0.05 < found["holes"] < 1
