"""A whole grid of occupancy, of which only what is likely is evaluated node by node."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import CoarseToFineConfig
from brrp_cli.geometry import grid_nodes
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
    nodes = grid_nodes(axis[::step] for axis in axes)
    coarse = probability(nodes.reshape(-1, 3)).reshape(nodes.shape[:3])
    shape = tuple(len(axis) for axis in axes)
    index = grid_nodes(map(np.arange, shape))
    # The last nodes of an axis may lie beyond the last coarse one: evaluated in any case.
    cell = index // step
    beyond = (index > step * (np.array(coarse.shape) - 1)).any(axis=-1)
    likely = maximum_filter(coarse, size=3, mode="nearest") > config.empty
    evaluated = likely[tuple(np.moveaxis(cell, -1, 0))] | beyond
    result = np.empty(shape, dtype=np.float32)
    if not evaluated.all():
        place = np.moveaxis(index[~evaluated], -1, 0) / step
        result[~evaluated] = map_coordinates(coarse, place, order=1, mode="nearest")
    points = np.stack([axis[i] for axis, i in zip(axes, index[evaluated].T, strict=True)], axis=-1)
    result[evaluated] = probability(points)
    return result
