"""Sensor noise: known sizes of each effect."""

import numpy as np
import pytest

from brrp_cli.depth_noise import structured_light as noise

K = np.array([[610.0, 0, 320], [0, 610, 240], [0, 0, 1]])


def wall(z: float) -> np.ndarray:
    return np.full((480, 640), z)


@pytest.mark.parametrize(
    ("z", "expected"), [(0.4, 0.0012), (0.9, 0.0012 + 0.0019 * 0.25), (1.4, 0.0031)]
)
def test_axial_deviation_of_a_facing_wall_is_that_of_the_source(z, expected):
    assert noise.axial_deviation(np.array(z), np.array(0.0)) == pytest.approx(expected)


def test_axial_deviation_grows_with_the_angle_and_stays_finite():
    angles = np.deg2rad([0, 30, 60, 85, 90])
    deviation = noise.axial_deviation(np.full(5, 1.0), angles)
    assert (np.diff(deviation[:4]) > 0).all()
    assert np.isfinite(deviation).all()
    assert deviation[2] == pytest.approx(0.0012 + 0.0019 * 0.36 + 0.0001 * 4)


def test_measured_noise_of_a_wall_is_axial_noise_plus_quantisation():
    noisy = noise.add_depth_noise(wall(1.0), K, np.random.default_rng(0))
    inner = noisy[10:-10, 100:540].astype(np.float64)
    step = noise.QUANTISATION
    sigma = 0.0012 + 0.0019 * 0.36  # the angle adds at most 0.02 mm inside this image
    assert inner.std() == pytest.approx(np.sqrt(sigma**2 + step**2 / 12), rel=0.05)
    assert inner.mean() == pytest.approx(1.0, abs=2e-4)


def test_depth_takes_only_whole_steps_of_disparity():
    noisy = noise.add_depth_noise(wall(0.9), K, np.random.default_rng(0))
    values = np.unique(noisy[noisy > 0].astype(np.float64))
    disparity = 1 / (noise.QUANTISATION * values)
    np.testing.assert_allclose(disparity, np.rint(disparity), atol=1e-3)
    step = np.diff(values)[len(values) // 2]
    assert step == pytest.approx(noise.QUANTISATION * 0.81, rel=0.05)


def test_incidence_angle_of_a_tilted_plane():
    # The plane z = 1 + tan(40 deg) x, met on the optical axis at 40 degrees.
    u = np.arange(640)
    x_over_z = (u - 320) / 610
    z = 1 / (1 - np.tan(np.deg2rad(40)) * x_over_z)
    angle = noise.incidence_angle(np.tile(z, (480, 1)), K)
    assert np.rad2deg(angle[240, 320]) == pytest.approx(40, abs=0.1)


def test_the_projector_casts_a_shadow_of_the_known_width_on_the_right_side():
    depth = wall(1.0)
    depth[:, 200:300] = 0.8
    shadow = noise.projector_shadow(depth, 610.0)
    width = 610 * noise.BASELINE * (1 / 0.8 - 1)
    assert not shadow[:, :300].any()
    assert shadow[0].sum() == pytest.approx(width, abs=1)
    assert shadow[0, 300:].argmin() == shadow[0].sum()


def test_pixels_at_depth_edges_go_missing_and_nothing_else():
    depth = wall(1.0)
    depth[100:, :] = 0.8
    noisy = noise.add_depth_noise(depth, K, np.random.default_rng(0))
    missing_rows = np.flatnonzero((noisy == 0).all(axis=1))
    assert missing_rows.tolist() == [99, 100]
    assert (noisy[noisy == 0].size) == 2 * 640


def test_no_return_stays_no_return_whatever_it_is_written_as():
    depth = wall(1.0)
    depth[10, 10], depth[20, 20], depth[30, 30], depth[40, 40] = 0, np.nan, np.inf, -1
    noisy = noise.add_depth_noise(depth, K, np.random.default_rng(0))
    assert noisy.dtype == np.float32
    assert np.isfinite(noisy).all()
    assert (noisy[[10, 20, 30, 40], [10, 20, 30, 40]] == 0).all()
    assert (noisy >= 0).all()


def test_same_generator_state_same_bytes_and_the_input_is_left_alone():
    depth = wall(1.0)
    before = depth.copy()
    first = noise.add_depth_noise(depth, K, np.random.default_rng(3))
    assert first.tobytes() == noise.add_depth_noise(depth, K, np.random.default_rng(3)).tobytes()
    assert first.tobytes() != noise.add_depth_noise(depth, K, np.random.default_rng(4)).tobytes()
    np.testing.assert_array_equal(depth, before)
