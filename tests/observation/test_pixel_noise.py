"""The noise that is read off a frame is the noise that was put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from table_scene import TABLE, in_camera, photograph, placed

from brrp_cli.config import SensorConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.shapes import solids

CONFIG = SensorConfig()


def disturbed(fine: float, wave: float = 0.0, width: float = 6.0) -> Frame:
    """A table with a box on it; depth with independent noise and with waves, standard deviations
    in metres, `width` pixels wide."""
    frame = photograph({1: in_camera(solids.box(0.1, 0.06, 0.14), placed(0.0, 0.0, 0.5))})
    rng = np.random.default_rng(0)
    waves = gaussian_filter(rng.normal(size=frame.shape), width)
    error = fine * rng.normal(size=frame.shape) + wave * waves / waves.std()
    depth = frame.points[..., 2:]
    return replace(frame, points=(frame.points * (1 + error[..., None] / depth)).astype(np.float32))


@pytest.mark.parametrize("fine", [0.0004, 0.002])
def test_a_pixels_own_noise_is_found_whatever_way_the_surface_leans(fine):
    frame = disturbed(fine)
    noise = pixel_noise(frame, TABLE, CONFIG)
    for part in (frame.segmap == 0, frame.segmap == 1):
        inner = part & frame.valid & ~noise.at_jump
        assert np.median(noise.fine[inner]) == pytest.approx(fine, rel=0.15)


def test_waves_are_not_taken_for_a_pixels_own_noise():
    frame = disturbed(0.0004, wave=0.002)
    noise = pixel_noise(frame, TABLE, CONFIG)
    assert np.median(noise.fine[frame.segmap == 0]) < 0.0006
    # Somewhat less than was put in: what is smooth over 12 cm is left out.
    assert 0.0012 < noise.wave < 0.0022


def test_independent_patches_are_a_vote_each_and_patches_of_one_wave_are_not():
    """A Gaussian filter of deviation w correlates noise as a Gaussian of deviation w sqrt 2, whose
    integral is 4 pi w^2."""
    assert pixel_noise(disturbed(0.004), TABLE, CONFIG).patches_per_vote < 1.5
    narrow, wide = (
        pixel_noise(disturbed(0.0, 0.002, width), TABLE, CONFIG).patches_per_vote
        for width in (3.0, 6.0)
    )
    pixels = CONFIG.patch * 300 / 0.76  # across a patch
    assert narrow == pytest.approx(1 + 4 * np.pi * (3 / pixels) ** 2, rel=0.6)
    assert wide > 1.8 * narrow


def test_waves_grow_with_the_square_of_the_distance():
    noise = pixel_noise(disturbed(0.0, 0.002), TABLE, CONFIG)
    assert noise.wave_at(2 * noise.depth) == pytest.approx(4 * noise.wave)


def test_jumps_of_depth_are_marked_and_no_more():
    frame = disturbed(0.0005)
    at_jump = pixel_noise(frame, TABLE, CONFIG).at_jump
    rows, columns = np.nonzero(frame.segmap == 1)
    top = rows.min()  # the box's upper edge stands before the table far behind
    assert at_jump[top - 1 : top + 1, int(np.median(columns[rows == top]))].all()
    assert at_jump.mean() < 0.06


def test_without_a_table_the_configuration_tells():
    noise = pixel_noise(disturbed(0.0005), None, CONFIG)
    assert (noise.wave_at(1.0), noise.patches_per_vote) == (
        CONFIG.untold_wave,
        CONFIG.patches_per_vote,
    )


def test_pixels_without_depth_have_a_noise_too():
    frame = disturbed(0.001)
    points = frame.points.copy()
    points[40:80, 50:90] = np.nan
    noise = pixel_noise(replace(frame, points=points), TABLE, CONFIG)
    assert np.isfinite(noise.fine).all() and (noise.fine > 0).all()
