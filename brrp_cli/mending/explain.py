"""What a recognised object explains of a frame, as it was placed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.mending import MendConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, project, transform_points
from brrp_cli.prior.store import Prior
from brrp_cli.reconstruction import Retrieved
from brrp_cli.segmentation.mend_masks import explained_pixels

Mask = NDArray[np.bool_]


def rendered(found: Retrieved, prior: Prior, frame: Frame) -> NDArray[np.float64]:
    """Depth (H, W), metres, of the stored object as it was placed and seen alone; 0 elsewhere."""
    assert found.T_cam_object is not None
    shape = prior.load(found.name).shape
    vertices = transform_points(found.T_cam_object, shape.vertices.astype(np.float64))
    depth = np.zeros(frame.shape)
    if (vertices[:, 2] <= 0).any():
        return depth
    # Only the window of the image that the object fills is looked into.
    pixels = project(vertices, frame.K)
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int), 0, frame.shape[::-1])
    high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 1, 0, frame.shape[::-1])
    window = (slice(low[1], high[1]), slice(low[0], high[0]))
    if depth[window].size:
        # Rays with z = 1 go as often as the depth is.
        length, _ = shape.met(
            found.T_cam_object, backproject(np.ones(frame.shape), frame.K)[window]
        )
        depth[window] = np.where(np.isfinite(length), length, 0.0)
    return depth


def tolerance(frame: Frame, config: MendConfig) -> NDArray[np.float64]:
    """(H, W) metres within which rendered depth explains measured depth; 0 where there is none."""
    depth = measured(frame)
    with np.errstate(invalid="ignore"):
        noise = config.noise + config.noise_growth * depth**2
    return np.nan_to_num(config.sigmas * np.hypot(noise, config.pose))


def measured(frame: Frame) -> NDArray[np.floating]:
    """(H, W) metres, NaN where there is no depth."""
    return np.where(frame.valid, frame.points[..., 2], np.nan)


def explained(found: Retrieved, prior: Prior, frame: Frame, config: MendConfig) -> Mask:
    """Pixels (H, W) whose measured depth the object explains as it was placed."""
    return explained_pixels(
        rendered(found, prior, frame), measured(frame), tolerance(frame, config)
    )
