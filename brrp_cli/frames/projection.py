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
    return np.asarray(at_pixels(points, frame.depth, frame) - points[:, 2])


def at_pixels(
    points: NDArray[np.floating], image: NDArray[np.generic], frame: Frame
) -> NDArray[np.float64]:
    """Values (n,) of an image (H, W) at the pixels of points (n, 3), camera frame; NaN outside of
    the image and behind the camera."""
    pixel, inside = pixel_numbers(points, frame)
    return np.where(inside, image.ravel()[pixel], np.nan)


def between_pixels(
    points: NDArray[np.floating], image: NDArray[np.floating], frame: Frame
) -> NDArray[np.float64]:
    """Values (n,) of an image (H, W) at points (n, 3), camera frame, interpolated between the four
    pixels around each; NaN where one of these has none, outside of the image and behind the
    camera."""
    from scipy.ndimage import map_coordinates

    with np.errstate(all="ignore"):
        # Behind the camera is outside of the image, and no coordinate is NaN.
        u, v = np.where(points[:, 2:] > 0, project(points, frame.K), -1.0).T
    return np.asarray(map_coordinates(image, (v, u), np.float64, order=1, cval=np.nan))


def pixel_numbers(
    points: NDArray[np.floating], frame: Frame
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The pixels of points (n, 3), camera frame, numbered row by row (n,), and which points (n,)
    have one: others lie outside of the image or behind the camera, and get number 0."""
    height, width = frame.shape
    z = points[:, 2]
    with np.errstate(all="ignore"):
        u, v = (
            np.rint(points[:, i] / z * frame.K[i, i] + frame.K[i, 2], dtype=np.float64)
            for i in range(2)
        )
        inside = (z > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        number = np.where(inside, v * width + u, 0)
    return number.astype(np.int64), inside
