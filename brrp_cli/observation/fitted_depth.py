"""Depth of one object without the noise of single pixels and the steps of the sensor.

The depth of a plane is such that 1 / z is an affine function of the pixel, and that of a curved
surface is one of second order, nearly. So each pixel takes the value of the quadratic function that
fits its neighbours, over the largest of a few neighbourhoods in which one fits to within the
sensor's noise: faces are averaged over centimetres, edges hardly. (The average of neighbours that
masks are made with, brrp_cli/segmentation/smooth_depth.py, would flatten what is curved.)
"""

from __future__ import annotations

import numpy as np

from brrp_cli.config import FittedDepthConfig
from brrp_cli.frames.dilate import mask_box
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.fitted_loops import surfaces_fitted
from brrp_cli.observation.pixel_noise import PixelNoise


def smoothed(frame: Frame, object_id: int, noise: PixelNoise, config: FittedDepthConfig) -> Frame:
    """The frame with the object's points moved along their rays."""
    mask = (frame.segmap == object_id) & frame.valid
    if not mask.any():
        return frame
    box = mask_box(mask, 0)
    own = mask[box]
    z = np.where(own, frame.points[box][..., 2], np.nan).astype(np.float64)
    depth = float(np.nanmedian(z))
    wave = config.wave * noise.wave_at(depth)
    deviation = np.hypot(noise.fine[box].astype(np.float64), wave) / z**2
    pixels = [round(reach * frame.K[0, 0] / depth) for reach in config.reaches]
    radii = np.unique(np.clip(pixels, config.least_pixels, config.most_pixels)).astype(np.int64)
    found = surfaces_fitted(
        1 / z,
        deviation,
        radii,
        config.gate,
        config.fit,
        config.least_neighbours,
        config.least_pivot,
    )
    points = frame.points.copy()
    points[box][own] *= (1 / (z * found))[own][:, None].astype(points.dtype)
    return frame.with_points(points)
