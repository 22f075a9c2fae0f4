"""Which of the placements that look alike in depth has the colours that the camera saw.

A box is the same from its front and its back, a can whichever way it is turned: depth cannot tell,
and colour can.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import ColourConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind, pixel_numbers
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.model import Model

Array = NDArray[np.float64]


def turned_about_itself(T_cam_model: Array, turns: int) -> Array:
    """Placements (B, 4, 4) of a model turned about each axis of its box, both ways up: those under
    which a box, a can or a bottle looks alike, among others. The first is the placement itself."""
    angles = np.arange(turns) * (2 * np.pi / turns)
    found = [Rotation.identity()]
    for axis, other in (("z", "x"), ("y", "z"), ("x", "y")):
        for flip in (Rotation.identity(), Rotation.from_euler(other, np.pi)):
            found += [Rotation.from_euler(axis, angle) * flip for angle in angles]
    return np.stack([T_cam_model @ similarity(rotation=each.as_matrix()) for each in found])


def colour_agreement(T_cam_model: Array, model: Model, frame: Frame, config: ColourConfig) -> float:
    """Correlation, -1 to 1, of the stored colours of what faces the camera, placed by T_cam_model
    (4, 4), with the image's at the same pixels; each channel about its own mean, so that the
    light's brightness and hue do not count. 0 where there is too little to see, or nothing but one
    colour."""
    shape = model.stored.shape
    rows = np.linspace(0, len(shape.vertices) - 1, config.vertices).astype(np.int64)
    points = transform_points(
        T_cam_model, shape.vertices[rows].astype(np.float64) * model.stored.half_extent
    )
    normals = shape.normals[rows] @ T_cam_model[:3, :3].T
    facing = np.einsum("ni,ni->n", normals, points) < 0
    pixel, inside = pixel_numbers(points, frame)
    near = np.abs(np.nan_to_num(depth_behind(points, frame), nan=np.inf)) < config.near
    seen = facing & inside & near
    if seen.sum() < config.least_seen:
        return 0.0
    stored = shape.colours[rows[seen]].astype(np.float64)
    image = frame.rgb.reshape(-1, 3)[pixel[seen]].astype(np.float64)
    stored, image = stored - stored.mean(axis=0), image - image.mean(axis=0)
    spread = np.linalg.norm(stored), np.linalg.norm(image)
    if min(spread) < config.plain * np.sqrt(stored.size):
        return 0.0
    return float((stored * image).sum() / (spread[0] * spread[1]))
