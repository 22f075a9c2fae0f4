"""A plane through a heap of things, lowered to what they stand on.

Of a table that is black or shiny so little may have depth that a plane through the things on it
holds more points. Half of these lie beneath it, and nothing lies beneath a table, but for a floor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import HeapConfig
from brrp_cli.observation.patches import Ransac, axes_of, largest_of
from brrp_cli.observation.support_plane import Plane
from brrp_cli.seeds import child_seed

Points = NDArray[np.float64]


def lowered(plane: Plane, points: Points, seed: int, config: HeapConfig, ransac: Ransac) -> Plane:
    """The plane, or where many of points (n, 3), metres, camera frame, lie little beneath it, the
    one that bears them: the largest among these, again and again, and then among the lowest points
    of all, of which a table has many, however thinly it is seen."""
    if not _through_a_heap(plane, points, config, ransac):
        return plane
    low = plane
    for turn in range(config.rounds):
        height = low.signed_distance(points)
        beneath = points[(height < -ransac.tolerance) & (height > -config.deep)]
        own = ransac.drawing(len(beneath) / len(points))
        found = largest_of(beneath, child_seed(seed, "lowered", turn), own)
        if found is None or not _alike(found, plane, config):
            return plane
        low = found
        if not _through_a_heap(low, points, config, ransac):
            break
    for turn in range(config.rounds):
        found = largest_of(lowest(low, points, config), child_seed(seed, "lowest", turn), ransac)
        if found is None or not _alike(found, plane, config):
            break
        low = found
    return low


def lowest(plane: Plane, points: Points, config: HeapConfig) -> Points:
    """(m, 3) of points (n, 3), those that are lowest over each cell of a plane, up to `config.deep`
    above or beneath it."""
    height = plane.signed_distance(points)
    near = np.abs(height) < config.deep
    points, height = points[near], height[near]
    cells = np.floor(points @ axes_of(plane).T / config.cell).astype(np.int64)
    order = np.lexsort((height, cells[:, 1], cells[:, 0]))
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(cells[order], axis=0) != 0).any(axis=1)
    return points[order[first]]


def _through_a_heap(plane: Plane, points: Points, config: HeapConfig, ransac: Ransac) -> bool:
    height = plane.signed_distance(points)
    beneath = (height < -config.off) & (height > -config.deep)
    return int(beneath.sum()) > config.beneath * int((np.abs(height) < ransac.tolerance).sum())


def _alike(one: Plane, other: Plane, config: HeapConfig) -> bool:
    return bool(one.normal @ other.normal > np.cos(np.radians(config.turn)))
