import numpy as np
import pytest

from brrp_cli.descriptors.colour_histogram import COLOUR_BINS, colour_histograms, lab, palette
from brrp_cli.descriptors.descriptor import roots, to_bytes

PLAIN = np.ones((1, 3))


def alike(one, two):
    return float(np.sqrt(one) @ np.sqrt(two))


def histogram(rgb, gains=PLAIN):
    return colour_histograms(*palette(rgb), np.asarray(gains))


@pytest.mark.parametrize(
    ("rgb", "expected"),
    [
        ((255, 255, 255), (100, 0, 0)),
        ((0, 0, 0), (0, 0, 0)),
        ((255, 0, 0), (53.24, 80.09, 67.20)),
        ((0, 0, 255), (32.30, 79.19, -107.86)),
    ],
)
def test_lab_of_known_colours(rgb, expected):
    np.testing.assert_allclose(lab(np.array(rgb)), expected, atol=0.15)


def test_a_palette_keeps_the_mean_and_the_shares():
    rgb = np.random.default_rng(0).integers(0, 256, (500, 3)).astype(np.uint8)
    colours, shares = palette(rgb)
    assert len(colours) < len(rgb) and shares.sum() == pytest.approx(1)
    np.testing.assert_allclose(shares @ colours, rgb.mean(axis=0))


def test_histograms_sum_to_one_and_differ_by_colour():
    red, dark_red = np.array([[200.0, 20, 20]]), np.array([[190.0, 25, 20]])
    green = np.array([[20.0, 200, 20]])
    h = [histogram(c)[0] for c in (red, dark_red, green)]
    assert all(x.shape == (COLOUR_BINS,) and x.sum() == pytest.approx(1) for x in h)
    assert alike(h[0], h[1]) > 0.9
    assert alike(h[0], h[2]) == 0


def test_a_gain_undoes_the_light():
    rng = np.random.default_rng(1)
    texture = rng.uniform(20, 110, (400, 3)) * [1.0, 0.6, 0.3]
    light = np.array([1.4, 1.5, 2.2])
    there = histogram(texture)[0]
    undone, plain = histogram(texture / light, [light, np.ones(3)])
    assert alike(undone, there) > 0.97
    assert alike(plain, there) < alike(undone, there) - 0.04


def test_bytes_keep_likeness():
    rng = np.random.default_rng(2)
    one, two = (rng.dirichlet(np.full(COLOUR_BINS, 0.1)) for _ in range(2))
    stored = roots(to_bytes(np.stack([one, two])))
    assert stored[0] @ stored[1] == pytest.approx(alike(one, two), abs=0.01)
    assert stored[0] @ stored[0] == pytest.approx(1, abs=0.01)
