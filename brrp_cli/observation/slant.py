"""How much a surface slants to the camera's sight, by the depth of its pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.inference import SlantConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.dilate import mask_box
from brrp_cli.frames.frame import Frame


def across_surface(frame: Frame, object_id: int, config: SlantConfig) -> NDArray[np.float32]:
    """(H, W) metres across an object's surface for a metre along the camera's axis: 1 where it is
    seen straight on, and where there is no depth of it.

    The ray r of a pixel, of z = 1, meets a plane n . x = d at the depth z with 1 / z = n . r / d.
    That is affine in the pixel: its slopes are n_x / (d f_x) and n_y / (d f_y). A metre along the
    axis is |n . r| / |n| across the plane.
    """
    found = np.ones(frame.shape, np.float32)
    own = (frame.segmap == object_id) & frame.valid
    box = mask_box(own, 0)
    if min(own[box].shape) < 3:
        return found
    own, depth = own[box], frame.depth[box].astype(np.float64)
    inverse = np.where(own, 1 / np.where(own, depth, 1.0), np.nan)
    slopes = _averaged(list(np.gradient(inverse)), config)
    if slopes is None:
        return found
    down, right = slopes
    n_x, n_y = right * frame.K[0, 0], down * frame.K[1, 1]
    rays = frame.points[box] / np.where(own, depth, 1.0)[..., None]
    n_z = inverse - n_x * rays[..., 0] - n_y * rays[..., 1]
    with np.errstate(invalid="ignore"):
        share = inverse / np.sqrt(n_x**2 + n_y**2 + n_z**2)
    found[box][own] = np.maximum(share[own], config.least)
    return found


def _averaged(
    slopes: list[NDArray[np.float64]], config: SlantConfig
) -> list[NDArray[np.float64]] | None:
    """Slopes (h, w), averaged over their neighbourhood, and where nothing is known in it, over the
    nearest one; None where none is known."""
    ndimage = import_library("scipy.ndimage")
    known = np.isfinite(slopes).all(axis=0)
    weight = ndimage.gaussian_filter(known.astype(np.float64), config.blur)
    unknown = weight < config.known
    if unknown.all():
        return None
    nearest = tuple(
        ndimage.distance_transform_edt(unknown, return_distances=False, return_indices=True)
    )
    return [
        (
            ndimage.gaussian_filter(np.where(known, each, 0.0), config.blur)
            / np.maximum(weight, 1e-9)
        )[nearest]
        for each in slopes
    ]
