"""What stands around the objects and is none of them: walls of a bin, posts, what was left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import SurroundingsConfig
from brrp_cli.config.segmentation import SmoothDepthConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.observation.subsample import grid_subsample
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.smooth_depth import flying_pixels

Array = NDArray[np.float64]


def standing_around(
    frame: Frame,
    plane: Plane | None,
    objects: NDArray[np.floating],
    config: SurroundingsConfig,
    smooth: SmoothDepthConfig,
    arms: NDArray[np.bool_] | None = None,
) -> Array:
    """(n, 3) observed points of no object that rise from the table within a hand's reach of the
    objects; metres, camera frame. None without a table, which could be told from nothing.

    objects : (m, 3) points of their surfaces; smooth : which pixels fly, and are none. Depth bleeds
    over silhouettes, so that what is nearer to an object may be its own. arms : (H, W) pixels of
    what will be elsewhere once a hand comes, with what is as near to it
    """
    if plane is None or not len(objects):
        return np.zeros((0, 3))
    depth = np.where(frame.valid, frame.points[..., 2], np.nan)
    seen = frame.valid & ~flying_pixels(depth, smooth)
    seen &= frame.segmap == BACKGROUND
    points = frame.points[seen if arms is None else seen & ~arms].astype(np.float64)
    points = points[plane.signed_distance(points) > config.rises]
    points = grid_subsample(points, config.cell).astype(np.float64)
    distance = _distance(points, objects, config.reach, config)
    around = (distance > config.beside) & np.isfinite(distance)
    if arms is not None and arms.any():
        around &= _distance(points, frame.points[arms], config.beside, config) > config.beside
    return np.asarray(points[around])


def _distance(
    points: Array, others: NDArray[np.floating], most: float, config: SurroundingsConfig
) -> Array:
    """(n,) metres from points (n, 3) to the nearest of others (m, 3), thinned; infinite beyond
    `most`."""
    tree = import_library("scipy.spatial").cKDTree(grid_subsample(others, config.cell))
    return np.asarray(tree.query(points, distance_upper_bound=most)[0])
