import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from views import BOX, SHAPE, K, facing, wall, wall_and_box

from brrp_cli.depth_noise.kinect_azure import HALF_WAVE, kinect_azure_depth
from brrp_cli.depth_noise.multipath import bounced_light
from brrp_cli.depth_noise.view import View


def measure(view, seed=0):
    return kinect_azure_depth(view, np.random.default_rng(seed))


def corner(angle=45.0):
    """Two walls that meet in a vertical edge 1 m away, each turned by `angle` degrees."""
    x = (np.arange(SHAPE[1]) - K[0, 2]) / K[0, 0]
    slope = 1 / np.tan(np.radians(angle))
    depth = np.broadcast_to(1 / (1 + slope * np.abs(x)), SHAPE)
    normals = np.zeros((*SHAPE, 3))
    normals[..., 0] = -np.sign(x) * np.cos(np.radians(angle))
    normals[..., 2] = -np.sin(np.radians(angle))
    return View(depth.copy(), K, normals, np.full(SHAPE, 0.7), np.zeros(SHAPE))


def test_the_same_seed_gives_the_same_bytes():
    view = facing(wall_and_box())
    assert measure(view, 1).tobytes() == measure(view, 1).tobytes()
    assert measure(view, 1).tobytes() != measure(view, 2).tobytes()


def test_a_wall_is_measured_to_a_few_millimetres():
    depth = np.stack([measure(facing(wall()), seed) for seed in range(6)])
    assert (depth > 0).all()
    error = 1e3 * (depth - 0.9)
    assert abs(error.mean()) < 2
    assert 0.7 < error.std() < 3


def test_dark_is_noisy_and_black_is_missing():
    bright, dark, black = (measure(facing(wall(), albedo)) for albedo in (0.8, 0.1, 0.01))
    high = lambda depth: np.diff(depth, axis=1).std()  # noqa: E731
    assert high(dark) > 2 * high(bright)
    assert (black == 0).mean() > 0.9


def test_silhouettes_have_flying_pixels_in_between_and_no_others():
    depth = measure(facing(wall_and_box(0.9, 0.8)))
    flying = (depth > 0.81) & (depth < 0.89)
    inside = np.zeros(SHAPE, dtype=bool)
    inside[BOX[0].start - 4 : BOX[0].stop + 4, BOX[1].start - 4 : BOX[1].stop + 4] = True
    inside[BOX[0].start + 4 : BOX[0].stop - 4, BOX[1].start + 4 : BOX[1].stop - 4] = False
    assert flying[inside].sum() > 200
    assert not flying[~inside].any()


def test_a_mix_of_opposite_phases_is_dropped():
    depth = measure(facing(wall_and_box(0.9, 0.9 - HALF_WAVE / 2)))
    edge = depth[BOX[0], BOX[1].start - 1 : BOX[1].start + 1]
    assert (edge == 0).any(axis=1).mean() > 0.9


def test_a_concave_corner_looks_too_deep_and_a_wall_does_not():
    hollow = corner()
    error = 1e3 * (np.stack([measure(hollow, s) for s in range(6)]).mean(axis=0) - hollow.depth)
    middle = error[60:180, 130:190]
    assert 3 < np.median(middle) < 40
    assert not np.abs(bounced_light(facing(wall()), HALF_WAVE)).max() > 1e-9


def test_light_bounced_in_a_corner_is_a_fair_share_of_the_direct():
    hollow = corner()
    share = np.abs(bounced_light(hollow, HALF_WAVE)) / hollow.signal
    assert share.max() == pytest.approx(0.3, abs=0.25)
