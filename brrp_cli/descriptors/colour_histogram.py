"""Colours as a joint histogram in CIE L*a*b*, and the same colours in other light."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

# Few steps of lightness, since shading moves it, and more of hue and chroma.
L_BINS, AB_BINS = 4, 7
COLOUR_BINS = L_BINS * AB_BINS**2
# Chroma at the histogram's edge, and the chroma below which steps are finest: most of what stands
# on tables is nearly grey.
AB_RANGE = 90.0
AB_KNEE = 15.0
# Colours are rounded to this many levels of each channel before anything is computed of them.
_LEVELS = 16

_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_WHITE = np.array([0.9505, 1.0, 1.089])


def lab(rgb: NDArray[np.floating]) -> NDArray[np.float64]:
    """L*a*b* (..., 3), D65, of sRGB colours (..., 3) from 0 to 255."""
    x = np.clip(np.asarray(rgb, dtype=np.float64), 0, 255) / 255
    linear = np.where(x > 0.04045, ((x + 0.055) / 1.055) ** 2.4, x / 12.92)
    xyz = linear @ _XYZ.T / _WHITE
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    lightness = 116 * f[..., 1] - 16
    return np.stack(
        [lightness, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1
    )


def palette(rgb: NDArray[np.generic]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Colours (k, 3) that stand for rgb (n, 3), and their shares (k,), sum 1."""
    step = 256 // _LEVELS
    levels = np.clip(np.asarray(rgb, dtype=np.float64), 0, 255).astype(np.int64) // step
    code = (levels[:, 0] * _LEVELS + levels[:, 1]) * _LEVELS + levels[:, 2]
    _, inverse, count = np.unique(code, return_inverse=True, return_counts=True)
    inverse = inverse.reshape(-1)
    sums = [np.bincount(inverse, np.asarray(rgb[:, c], dtype=np.float64)) for c in range(3)]
    return np.stack(sums, axis=-1) / count[:, None], count / len(code)


def colour_histograms(
    rgb: NDArray[np.floating], shares: NDArray[np.floating], gains: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Histograms (g, COLOUR_BINS), sum 1, of colours (k, 3), 0 to 255, with shares (k,).

    gains : (g, 3), factors of red, green and blue: the same colours in g lights. Each colour is
    shared linearly among the eight bins around it.
    """
    lit = np.minimum(rgb[None] * gains[:, None], 255.0)
    # The axis comes first: long contiguous rows are what NumPy is fast on.
    position = np.ascontiguousarray(np.moveaxis(_positions(lab(lit)), -1, 0))
    low = position.astype(np.int64)
    rest = position - low
    parts = np.stack([1 - rest, rest], axis=1)
    counts = np.zeros((len(gains), COLOUR_BINS))
    row = np.arange(len(gains))[:, None] * COLOUR_BINS
    first = row + (low[0] * AB_BINS + low[1]) * AB_BINS + low[2]
    for x, y, z in product((0, 1), repeat=3):
        weight = parts[0, x] * parts[1, y] * parts[2, z] * shares
        index = first + ((x * AB_BINS + y) * AB_BINS + z)
        counts += np.bincount(index.ravel(), weight.ravel(), minlength=counts.size).reshape(
            counts.shape
        )
    return (counts / np.maximum(counts.sum(axis=1, keepdims=True), 1e-12)).astype(np.float32)


def _positions(colours: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where L*a*b* (..., 3) lies on the grid of bins; below its last node on every axis."""
    ab = colours[..., 1:]
    chroma = np.linalg.norm(ab, axis=-1, keepdims=True) + 1e-9
    stretched = np.log1p(chroma / AB_KNEE) / np.log1p(AB_RANGE / AB_KNEE)
    ab = (ab / chroma * stretched + 1) / 2 * (AB_BINS - 1)
    lightness = colours[..., :1] / 100 * (L_BINS - 1)
    top = np.array([L_BINS - 1, AB_BINS - 1, AB_BINS - 1]) - 1e-6
    return np.clip(np.concatenate([lightness, ab], axis=-1), 0, top)
