"""Depth that pixels all over the image lack."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brrp_cli.config.observation import ScatteredHolesConfig
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.scattered_holes import without_scattered_holes
from brrp_cli.segmentation.segment import segment

K = np.array([[150.0, 0, 79.5], [0, 150.0, 59.5], [0, 0, 1]])
CONFIG = ScatteredHolesConfig()


def slope() -> np.ndarray:
    """Depth of a plane that the camera looks at aslant."""
    v, u = np.mgrid[:120, :160]
    return 0.5 / (0.7 + 0.5 * (v - 59.5) / 150 + 0.2 * (u - 79.5) / 150)


def one_of_four(shape: tuple[int, int]) -> np.ndarray:
    """Depth of half the size, put into the pixels of the colour image."""
    measured = np.zeros(shape, bool)
    measured[::2, ::2] = True
    return measured


def every_third_row(shape: tuple[int, int]) -> np.ndarray:
    measured = np.zeros(shape, bool)
    measured[::3] = True
    return measured


def seven_of_ten(shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(0).random(shape) < 0.7


PATTERNS = pytest.mark.parametrize("pattern", [one_of_four, every_third_row, seven_of_ten])


@PATTERNS
def test_a_plane_is_whole_again(pattern):
    depth = slope()
    measured = pattern(depth.shape)
    filled = without_scattered_holes(np.where(measured, depth, np.nan), K, CONFIG)
    inside = (slice(3, -3), slice(3, -3))
    np.testing.assert_allclose(filled[inside], depth[inside], rtol=1e-9)
    np.testing.assert_array_equal(filled[measured], depth[measured])


def test_holes_between_surfaces_one_behind_the_other_stay():
    depth = np.full((120, 160), 1.0)
    depth[:, 80:] = 0.8
    depth[::2] = np.nan
    depth[:, 79:81] = np.nan
    filled = without_scattered_holes(depth, K, CONFIG)
    assert np.isfinite(filled[1:-1, :79]).all() and np.isfinite(filled[1:-1, 81:]).all()
    assert np.isnan(filled[:, 79:81]).all()
    assert set(np.unique(filled[np.isfinite(filled)])) == {0.8, 1.0}


def test_what_is_dropped_as_a_whole_stays_a_hole():
    depth = slope()
    depth[::2] = np.nan
    depth[40:60, 50:90] = np.nan
    filled = without_scattered_holes(depth, K, CONFIG)
    assert np.isnan(filled[43:57, 53:87]).all()


def test_the_few_that_any_camera_loses_stay_holes():
    depth = slope()
    depth[np.random.default_rng(0).random(depth.shape) < 0.04] = np.nan
    assert without_scattered_holes(depth, K, CONFIG) is depth
    few = slope()[:20, :20]
    few[::2] = np.nan
    assert without_scattered_holes(few, K, CONFIG) is few, "too small an image to tell"
    assert without_scattered_holes(few, K, replace(CONFIG, least_pixels=1)) is not few


def test_a_frame_says_that_it_was_filled_and_keeps_what_was_measured(caplog):
    depth = slope().astype(np.float32)
    holes = ~seven_of_ten(depth.shape)
    with caplog.at_level("INFO"):
        frame = make_frame(depth=np.where(holes, 0, depth), K=K)
    assert "pixels without depth, scattered among others" in caplog.text
    assert frame.valid[3:-3, 3:-3].all()
    np.testing.assert_array_equal(frame.depth[~holes], depth[~holes])
    points = np.where(holes[..., None], np.nan, frame.points)
    again = make_frame(xyz=points, K=K)
    np.testing.assert_allclose(again.points, frame.points, atol=1e-6)


@PATTERNS
def test_masks_are_found_all_the_same(scene, pattern):
    """Without the filling there are fewer, or others."""
    depth = np.nan_to_num(scene.depth)
    whole = segment(make_frame(rgb=scene.rgb, depth=depth, K=scene.K))
    sparse = np.where(pattern(depth.shape), depth, 0)
    found = segment(make_frame(rgb=scene.rgb, depth=sparse, K=scene.K))
    assert found.max() == whole.max() == 3
    for number in (1, 2, 3):
        both = (found == number) & (whole == number)
        # The smallest is 14 rows high, and two of three rows at its ends are not measured.
        assert both.sum() > 0.7 * ((found == number) | (whole == number)).sum()
