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
    return hidden_by_itself(mask, frame, plane, config) >= config.hides


def hidden_by_itself(
    mask: NDArray[np.bool_], frame: Frame, plane: Plane, config: LeftOutConfig
) -> float:
    """The part of what lies straight below a mask (H, W), on the plane, that its own pixels hide
    from the camera. 0 where the image shows nothing of it.

    From above that is nearly all, whether it stands or hangs. From the side it is what reaches down
    to the table; of the upper part of something, other pixels hide it.
    """
    ndimage = import_library("scipy.ndimage")
    points = frame.points[mask & frame.valid].astype(np.float64)
    feet = points - plane.signed_distance(points)[:, None] * plane.normal
    pixel, inside = pixel_numbers(feet, frame)
    own = ndimage.binary_dilation(mask, iterations=config.reach).ravel()[pixel]
    return float(own[inside].mean()) if inside.any() else 0.0
