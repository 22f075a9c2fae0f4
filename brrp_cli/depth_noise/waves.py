"""Noise that is correlated over many pixels: a smooth random field."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library


def waves(
    shape: tuple[int, int], length: float | tuple[float, float], rng: np.random.Generator
) -> NDArray[np.float64]:
    """White noise (H, W) smoothed with a Gaussian of `length` pixels (rows, columns), scaled to
    zero mean and unit variance over all fields.

    The correlation of two pixels at distance r is exp(-r^2 / (4 length^2)).
    """
    ndimage = import_library("scipy.ndimage")
    rows, columns = (length, length) if isinstance(length, (int, float)) else length
    # Long waves are drawn on a coarse grid: the same field for far less work.
    step = max(1, int(min(rows, columns) // 4))
    margin = 2
    coarse = (shape[0] // step + 2 * margin + 1, shape[1] // step + 2 * margin + 1)
    sigma = (rows / step, columns / step)
    field = ndimage.gaussian_filter(rng.standard_normal(coarse), sigma, mode="wrap")
    field *= np.sqrt(4 * np.pi * sigma[0] * sigma[1])
    if step == 1:
        return np.asarray(field[margin : margin + shape[0], margin : margin + shape[1]])
    y = np.arange(shape[0])[:, None] / step + margin
    x = np.arange(shape[1])[None, :] / step + margin
    grid = np.broadcast_arrays(y, x)
    return np.asarray(ndimage.map_coordinates(field, grid, order=3, mode="grid-wrap"))
