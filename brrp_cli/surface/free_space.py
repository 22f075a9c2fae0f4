"""Balls that a frame shows to be empty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import MeanConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import at_pixels
from brrp_cli.observation.support_plane import Plane


def free_balls(
    points: NDArray[np.float64],
    radius: float,
    frame: Frame,
    plane: Plane | None,
    config: MeanConfig,
) -> NDArray[np.bool_]:
    """For each of points (n, 3), metres, camera frame, whether the frame shows a ball of `radius`
    metres around it to be empty: every pixel onto which the ball may fall shows a depth that lies
    behind all of it. Below the plane, by more than `config.carve_plane`, nothing is.

    A pixel without depth shows nothing, and nor does what lies beyond the image.
    """
    if not len(points):
        return np.zeros(0, np.bool_)
    free = np.zeros(len(points), np.bool_)
    if plane is not None:
        free = plane.signed_distance(points) < -config.carve_plane
    nearest = float(points[:, 2].min())
    if nearest <= radius:
        return free
    # The nearest point's ball is the largest in the image.
    wide = int(np.ceil(max(frame.K[0, 0], frame.K[1, 1]) * radius / (nearest - radius)))
    depth = np.where(frame.valid, frame.depth, 0.0)
    least = import_library("scipy.ndimage").minimum_filter(
        depth, 2 * wide + 1, mode="constant", cval=0.0
    )
    behind = at_pixels(points, least, frame) - points[:, 2]
    return free | (np.nan_to_num(behind, nan=-np.inf) > radius)
