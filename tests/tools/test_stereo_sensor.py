import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

pytest.importorskip("cv2")
pytest.importorskip("pybullet")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from tabletop.active_stereo import BASELINE, COLOUR_TO_LEFT, infrared_pair
from tabletop.sensors import SENSORS
from tabletop.stage import Stage, Surface, pixel_rays
from tabletop.stereo_matching import match, smooth_disparity, stereo_depth

SHAPE = (180, 240)
K = np.array([[400.0, 0, 119.5], [0, 400.0, 89.5], [0, 0, 1]])


def box(center, extents, albedo=0.6, gloss=0.0):
    mesh = trimesh.creation.box(extents)
    return Surface(
        mesh.vertices + np.array(center), np.asarray(mesh.faces), None, np.array(albedo), gloss
    )


def stage(*surfaces):
    """A wall 0.9 m away behind the surfaces."""
    return Stage((*surfaces, box((0, 0, 1.0), (4, 4, 0.2))), K, SHAPE)


BLOCK = box((0, 0, 0.75), (0.12, 0.1, 0.1))  # its face 0.7 m away


@pytest.fixture(scope="module")
def measured():
    return stereo_depth(stage(BLOCK), np.random.default_rng(0))


def test_the_registry_has_every_sensor_and_each_repeats_its_bytes(measured):
    assert set(SENSORS) == {"stereo", "xtion", "kinect-azure"}
    for name, sensor in SENSORS.items():
        first, second, other = (
            sensor(stage(BLOCK), np.random.default_rng(seed)) for seed in (0, 0, 1)
        )
        assert first.shape == SHAPE, name
        assert first.tobytes() == second.tobytes(), name
        assert first.tobytes() != other.tobytes(), name
        seen = first[60:120, 95:145]
        assert np.median(seen[seen > 0]) == pytest.approx(0.7, abs=0.006), name
        assert np.abs(first * 1000 - np.rint(first * 1000)).max() < 1e-9, name


def test_rays_meet_the_stage_where_it_is():
    view = stage(BLOCK).view(0.0)
    assert view.depth[90, 120] == pytest.approx(0.7, abs=1e-5)
    assert view.depth[5, 5] == pytest.approx(0.9, abs=1e-5)
    assert view.cosine[90, 120] == pytest.approx(1, abs=1e-4)
    assert pixel_rays(K, SHAPE, 2).shape == (360, 480, 3)


def test_both_views_show_the_same_dots_shifted_by_the_disparity():
    pair = infrared_pair(stage(), np.random.default_rng(0))
    shift = round(K[0, 0] * BASELINE / 0.9)
    left, right = pair.left[40:140, 60:220].astype(float), pair.right.astype(float)

    def correlation(by):
        beside = right[40:140, 60 - by : 220 - by]
        return np.corrcoef(left.ravel(), beside.ravel())[0, 1]

    assert correlation(shift) > 0.6
    assert abs(correlation(shift + 6)) < 0.2


def test_a_wall_waves_as_much_as_a_real_one():
    from tabletop.depth_statistics import waves_and_fine

    wall = stage()
    depth = stereo_depth(wall, np.random.default_rng(0))
    mask = np.zeros(SHAPE, dtype=bool)
    mask[10:-10, 50:-10] = True
    waves, fine = waves_and_fine(depth - 0.9, mask & (depth > 0))
    # 400 pixels of focal length, where the real cameras have 615.
    assert 1.2 < 1e3 * waves * 400 / 615 < 2.8
    assert 1e3 * fine * 400 / 615 < 1.1


def test_far_depth_comes_in_steps_of_a_32nd_of_a_pixel():
    from tabletop.depth_statistics import quantisation_step

    tilted = box((0, 0, 0), (6, 6, 0.1))
    turn = trimesh.transformations.rotation_matrix(np.radians(20), [1, 0, 0])[:3, :3]
    floor = replace(tilted, vertices=tilted.vertices @ turn.T + [0, 0, 2.2])
    depth = stereo_depth(Stage((floor,), K, SHAPE), np.random.default_rng(0))
    assert (depth > 0).mean() > 0.5
    step = quantisation_step(depth, depth > 1.8)
    assert step == pytest.approx(1 / (32 * K[0, 0] * BASELINE), rel=0.1)


def test_disparity_is_right_to_a_tenth_of_a_pixel():
    pair = infrared_pair(stage(), np.random.default_rng(0))
    found = smooth_disparity(match(pair, K[0, 0]))[10:-10, 40:-10]
    assert (found > 0).mean() > 0.98
    assert np.median(found[found > 0]) == pytest.approx(K[0, 0] * BASELINE / 0.9, abs=0.15)


def test_the_shadow_lies_to_the_left(measured):
    middle = measured[70:110]
    left, right = 86, 154  # the block's sides in the image
    width = K[0, 0] * (BASELINE + COLOUR_TO_LEFT) * (1 / 0.7 - 1 / 0.9)
    missing_left = (middle[:, 45:left] == 0).sum(axis=1).mean()
    missing_right = (middle[:, right:] == 0).sum(axis=1).mean()
    assert missing_left == pytest.approx(width, abs=3)
    assert missing_right < 2


def test_silhouettes_bleed_and_are_ragged(measured):
    true = stage(BLOCK).view(0.0).depth
    wrong = (measured > 0) & (np.abs(measured - true) > 0.03)
    outline = 2 * ((true < 0.8).any(axis=0).sum() + (true < 0.8).any(axis=1).sum())
    assert 0.2 < wrong.sum() / outline < 4
    widths = ((measured > 0) & (measured < 0.8))[70:110].sum(axis=1)
    assert widths.std() > 0.5
    assert widths.mean() == pytest.approx(68, abs=4)


def test_the_left_border_is_blind(measured):
    band = (measured[100:, :].max(axis=0) == 0).argmin()
    assert band == pytest.approx(K[0, 0] * (BASELINE + COLOUR_TO_LEFT) / 0.9, abs=6)


def test_black_is_missing():
    black = stereo_depth(
        stage(box((0, 0, 0.75), (0.12, 0.1, 0.1), albedo=0.01)), np.random.default_rng(0)
    )
    assert (black[70:110, 100:140] == 0).mean() > 0.5
