"""Whether a mask hides its own foot, as upright things do from above, or hangs over the table."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import LeftOutConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import pixel_numbers
from brrp_cli.observation.support_plane import Plane


def hides_its_foot(
    mask: NDArray[np.bool_],
    frame: Frame,
    plane: Plane,
    over: NDArray[np.bool_],
    config: LeftOutConfig,
) -> bool:
    """Whether a mask (H, W) that is seen to end above the table may reach down to it all the same.

    over : (H, W) pixels whose points lie over the table, no farther than it reaches
    """
    seen = mask & frame.valid
    if not seen.any() or over[seen].mean() < config.partly_over:
        return False
    return bare_beneath(mask, frame, plane, config) <= config.beneath


def bare_beneath(
    mask: NDArray[np.bool_], frame: Frame, plane: Plane, config: LeftOutConfig
) -> float:
    """The part of what lies straight below a mask (H, W), on the plane, that the camera sees to be
    bare: what is measured there lies on the plane or behind it, beyond the mask's own pixels.

    Something upright hides its foot, or its own pixels reach down to it. 1 of a mask below which
    nothing is known.
    """
    ndimage = import_library("scipy.ndimage")
    points = frame.points[mask & frame.valid].astype(np.float64)
    feet = points - plane.signed_distance(points)[:, None] * plane.normal
    pixel, inside = pixel_numbers(feet, frame)
    measured = frame.depth.ravel()[pixel]
    own = ndimage.binary_dilation(mask, iterations=config.reach).ravel()[pixel]
    known = inside & (own | (frame.valid.ravel()[pixel] & (measured > 0)))
    bare = known & ~own & (measured > feet[:, 2] - config.touch)
    return float(bare.sum() / known.sum()) if known.any() else 1.0
