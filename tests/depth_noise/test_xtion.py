import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

sys.path.insert(0, str(Path(__file__).parent))

from views import BOX, SHAPE, K, facing, wall, wall_and_box

from brrp_cli.depth_noise.xtion import BASELINE, SUBPIXEL, unlit, xtion_depth


def measure(view, seed=0):
    return xtion_depth(view, np.random.default_rng(seed))


def test_the_same_seed_gives_the_same_bytes():
    view = facing(wall_and_box())
    assert measure(view, 1).tobytes() == measure(view, 1).tobytes()
    assert measure(view, 1).tobytes() != measure(view, 2).tobytes()


def test_a_wall_waves_as_much_as_a_real_one():
    fields = [measure(facing(wall()), seed) - 0.9 for seed in range(6)]
    smooth = [ndimage.gaussian_filter(field, 5) for field in fields]
    waves = 1e3 * np.mean([s.std() for s in smooth])
    fine = 1e3 * np.mean([(f - s).std() for f, s in zip(fields, smooth, strict=True)])
    assert 1.2 < waves < 2.8
    assert 0.5 < fine < 1.4


def deviation(distance, seed):
    depth = measure(facing(wall(distance), albedo=0.9), seed)
    return depth[depth > 0].std()


def test_noise_grows_with_depth_squared():
    near, far = (np.mean([deviation(z, seed) for seed in range(4)]) for z in (0.7, 1.4))
    assert far / near == pytest.approx(4, rel=0.1)


def test_depth_comes_in_steps_of_disparity():
    depth = measure(facing(wall(2.5), albedo=0.9))
    depth = depth[depth > 0]
    steps = K[0, 0] * BASELINE / depth * SUBPIXEL
    assert np.abs(steps - np.rint(steps)).max() < 1e-6
    assert np.median(np.diff(np.unique(depth))) == pytest.approx(
        2.5**2 / (K[0, 0] * BASELINE * SUBPIXEL), rel=0.05
    )


def test_the_shadow_lies_to_the_right_and_is_as_wide_as_geometry_has_it():
    scale = K[0, 0] * BASELINE
    shadow = unlit(scale / wall_and_box())
    width = scale / 0.7 - scale / 0.9
    rows, columns = BOX
    assert shadow[rows, : columns.stop].sum() == 0
    assert shadow[rows, columns.stop :].sum(axis=1).mean() == pytest.approx(width, abs=1)
    missing = measure(facing(wall_and_box())) == 0
    left = missing[rows, columns.start - 20 : columns.start].sum(axis=1).mean()
    right = missing[rows, columns.stop : columns.stop + 30].sum(axis=1).mean()
    assert right > left + width / 2


def test_silhouettes_bleed_by_a_pixel_or_two_and_are_ragged():
    near = (measure(facing(wall_and_box())) > 0) & (measure(facing(wall_and_box())) < 0.8)
    widths = near[80:160].sum(axis=1)
    assert 0.5 < (widths.mean() - 100) / 2 < 3
    assert widths.std() > 0.5
    assert near[:, :100].sum() == 0


def test_dark_glossy_and_grazing_surfaces_are_missing():
    albedo, gloss = np.full(SHAPE, 0.6), np.zeros(SHAPE)
    albedo[:, :100] = 0.02
    gloss[:, 220:] = 0.9
    missing = measure(facing(wall(), albedo, gloss)) == 0
    assert missing[:, :100].mean() > 0.9
    assert missing[:, 110:210].mean() < 0.01
    assert missing[:, 230:].mean() > 0.5
    view = facing(wall())
    view.normals[:] = [np.cos(np.radians(5)), 0, -np.sin(np.radians(5))]
    assert (measure(view) == 0).mean() > 0.3


def test_nothing_gives_nothing():
    assert not measure(facing(np.zeros(SHAPE))).any()
