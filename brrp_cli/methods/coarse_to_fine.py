"""A whole grid of occupancy, of which only what is likely is asked node by node."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import CoarseToFineConfig
from brrp_cli.reconstruction import Axes

Probability = Callable[[NDArray[np.floating]], NDArray[np.float32]]


def coarse_to_fine_volume(
    probability: Probability, axes: Axes, config: CoarseToFineConfig
) -> NDArray[np.float32]:
    """`probability` (n,) of points (n, 3) on a grid (nx, ny, nz) of camera-frame coordinates,
    metres.

    Where it is under `config.empty` all around, values lie between those of coarse nodes.
    """
    from scipy.ndimage import map_coordinates, maximum_filter

    step = config.step
    coarse = _lattice(probability, (axes[0][::step], axes[1][::step], axes[2][::step]))
    shape = tuple(len(axis) for axis in axes)
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    # The last nodes of an axis may lie beyond the last coarse one: asked in any case.
    cell = index // step
    beyond = (index > step * (np.array(coarse.shape) - 1)).any(axis=-1)
    likely = maximum_filter(coarse, size=3, mode="nearest") > config.empty
    asked = likely[tuple(np.moveaxis(cell, -1, 0))] | beyond
    result = np.empty(shape, dtype=np.float32)
    if not asked.all():
        place = np.moveaxis(index[~asked], -1, 0) / step
        result[~asked] = map_coordinates(coarse, place, order=1, mode="nearest")
    points = np.stack([axis[i] for axis, i in zip(axes, index[asked].T, strict=True)], axis=-1)
    result[asked] = probability(points)
    return result


def _lattice(probability: Probability, axes: Axes) -> NDArray[np.float32]:
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return probability(nodes.reshape(-1, 3)).reshape(nodes.shape[:3])
