"""The region around a shape that no stored object explains.

The hypotheses about such an object agree on what all of them have wrong, so the region that their
posterior asks for is too small, the more so the further from what was seen. What was observed
itself is the object's, whatever the posterior makes of it.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.dependencies import import_library
from brrp_cli.geometry import grid_nodes
from brrp_cli.reconstruction import Axes
from brrp_cli.surface.extract import own_part

Array = NDArray[np.float64]


class Free(Protocol):
    """Where a ball was seen to be empty."""

    def __call__(self, points: Array, radius: float) -> NDArray[np.bool_]:
        """For each of points (n, 3), metres, camera frame, whether nothing can be within `radius`
        metres of it."""


def grown_by_guess(
    volume: NDArray[np.floating],
    axes: Axes,
    observed: NDArray[np.floating],
    free: Free,
    config: SurfaceConfig,
) -> tuple[Array, Axes]:
    """A volume (nx, ny, nz) on a wider grid, at least 1 in all that may be the object's, and the
    grid's axes.

    volume : 1 or more in the region that the posterior asks for; observed : (m, 3) points of the
    object. Lengths are metres, camera frame. Where the nearest place of that region lies a from the
    nearest observed point, the object may go beyond it by

        r(a) = min(around_seen + around_guessed a, around_most),

    and by `around_seen` beyond what was observed, but not where a ball of that radius is free:
    depth errs at outlines, and by as much a free pixel says nothing of its neighbourhood.
    """
    ndimage, spatial = import_library("scipy.ndimage"), import_library("scipy.spatial")
    own = own_part(volume, axes, observed, 1.0, config)
    volume = np.where((volume >= 1) & ~own, 0.0, volume)
    volume, axes = widened(volume, axes, config.around_most + config.around_seen)
    # A stray point far away is no reason for a grid that reaches there.
    low, high = np.array([(axis[0], axis[-1]) for axis in axes]).T
    inner = np.abs(observed - (low + high) / 2) < (high - low) / 2 - config.around_seen
    observed = observed[inner.all(axis=1)]
    spacing = float(axes[0][1] - axes[0][0])
    nodes = grid_nodes(axes)
    seen = spatial.cKDTree(observed)
    beyond, nearest = ndimage.distance_transform_edt(volume < 1, return_indices=True)
    beyond *= spacing
    short = (
        config.around_seen - seen.query(nodes, distance_upper_bound=config.around_seen + spacing)[0]
    )
    near = (beyond > 0) & (beyond < config.around_most + spacing)
    away, _ = seen.query(nodes[tuple(nearest[:, near])])
    reach = np.minimum(config.around_seen + config.around_guessed * away, config.around_most)
    short[near] = np.maximum(short[near], reach - beyond[near])
    may_grow = (beyond > 0) & (short > -spacing)
    may_grow[may_grow] = ~free(nodes[may_grow], config.around_seen)
    return np.where(may_grow, np.maximum(volume, 1 + short / spacing), volume), axes


def widened(volume: NDArray[np.floating], axes: Axes, margin: float) -> tuple[Array, Axes]:
    """A volume (nx, ny, nz) with nodes of 0 for at least `margin` metres more on each side, and the
    axes of that."""
    spacing = float(axes[0][1] - axes[0][0])
    cells = int(np.ceil(margin / spacing)) + 1
    steps = spacing * np.arange(1, cells + 1)
    x, y, z = (np.concatenate([a[0] - steps[::-1], a, a[-1] + steps]) for a in axes)
    return np.pad(volume.astype(np.float64), cells), (x, y, z)
