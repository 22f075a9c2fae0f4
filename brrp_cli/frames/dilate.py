"""Masks grown by a few pixels, at the cost of the mask and not of the image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def dilated(mask: NDArray[np.bool_], pixels: int) -> NDArray[np.bool_]:
    """A mask (H, W) and all that is within `pixels` steps along rows and columns of it."""
    from scipy.ndimage import binary_dilation

    grown = np.zeros_like(mask)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) and pixels > 0:
        box = tuple(
            slice(max(int(each[0]) - pixels, 0), int(each[-1]) + pixels + 1)
            for each in (rows, columns)
        )
        grown[box] = binary_dilation(mask[box], iterations=pixels)
        return grown
    return mask.copy()
