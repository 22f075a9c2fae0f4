"""Pixels at the edge of a mask whose depth is that of another object beside it.

Cameras that average over windows carry depth across edges, and masks are a pixel or two too wide.
Such pixels are as deep as the other object beside them, and far from the depth of their own a
little further inside. Of something that others hide but for a strip, they are a good part. How the
table mixes in is another matter: see mixed_edges.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import LentPixelsConfig


def lent_pixels(
    depth: NDArray[np.floating],
    mask: NDArray[np.bool_],
    others: NDArray[np.bool_],
    config: LentPixelsConfig,
) -> NDArray[np.bool_]:
    """(H, W) bool: pixels of an object's mask (H, W) that show one of the others (H, W).

    depth : (H, W) metres, of all of them, NaN where there is none
    """
    from scipy.ndimage import distance_transform_edt

    measured = np.isfinite(depth)
    # Beyond the image may be more of the object.
    inside = distance_transform_edt(np.pad(mask, 1, mode="edge"))[1:-1, 1:-1]
    edge = mask & measured & (inside <= config.edge)
    within, beside = mask & measured & (inside > config.edge), others & measured
    lent = np.zeros(mask.shape, dtype=np.bool_)
    if not (edge.any() and within.any() and beside.any()):
        return lent

    def off(pixels: NDArray[np.bool_]) -> NDArray[np.floating]:
        """Metres from the depth at the nearest of these pixels; NaN where that is too far away."""
        away, nearest = distance_transform_edt(~pixels, return_indices=True)
        there = depth[nearest[0][edge], nearest[1][edge]]
        return np.where(away[edge] <= config.reach, np.abs(depth[edge] - there), np.nan)

    lent[edge] = (off(beside) < config.alike) & (off(within) > config.apart)
    return lent
