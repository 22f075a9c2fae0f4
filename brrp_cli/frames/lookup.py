"""What a frame measured at the pixels of points in the camera frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import project


def depth_behind(points: NDArray[np.floating], frame: Frame) -> NDArray[np.float64]:
    """How far behind each of `points` (n, 3), camera frame, its pixel's measured depth lies,
    metres: positive in free space, negative where the point is hidden. NaN where the point's pixel
    has no depth, lies outside of the image or behind the camera."""
    return np.asarray(at_pixels(points, frame.points[..., 2], frame) - points[:, 2])


def at_pixels(
    points: NDArray[np.floating], image: NDArray[np.generic], frame: Frame
) -> NDArray[np.float64]:
    """Values (n,) of an image (H, W) at the pixels of points (n, 3), camera frame; NaN outside of
    the image and behind the camera."""
    found = np.full(len(points), np.nan)
    ahead = np.flatnonzero(points[:, 2] > 0)
    pixels = np.rint(project(points[ahead], frame.K)).astype(np.int64)
    height, width = frame.shape
    inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
    columns, rows = pixels[inside].T
    found[ahead[inside]] = image[rows, columns]
    return found
