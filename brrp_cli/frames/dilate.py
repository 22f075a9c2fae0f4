"""Masks grown or opened by a few pixels, at the cost of the mask and not of the image, and how far
pixels lie from one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def mask_box(mask: Mask, margin: int) -> tuple[slice, slice]:
    """Rows and columns that hold a mask (H, W) and `margin` pixels around it, as far as the image
    reaches; none of an empty one."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return slice(0), slice(0)
    low, high = (int(rows[0]), int(columns[0])), (int(rows[-1]), int(columns[-1]))
    by_row, by_column = (
        slice(max(a - margin, 0), b + margin + 1) for a, b in zip(low, high, strict=True)
    )
    return by_row, by_column


def widened(window: tuple[slice, slice], margin: int) -> tuple[slice, slice]:
    """A window of an image with `margin` pixels more around it, as far as the image reaches."""
    # What lies beyond its end NumPy leaves out by itself.
    rows, columns = (slice(max(cut.start - margin, 0), cut.stop + margin) for cut in window)
    return rows, columns


def distance_to(mask: Mask) -> NDArray[np.float64]:
    """(h, w) pixels to the nearest pixel of a mask (h, w); infinite where it is empty."""
    from scipy.ndimage import distance_transform_edt

    if not mask.any():
        return np.full(mask.shape, np.inf)
    return np.asarray(distance_transform_edt(~mask))


def dilated(mask: Mask, pixels: int) -> Mask:
    """A mask (H, W) and all that is within `pixels` steps along rows and columns of it."""
    from scipy.ndimage import binary_dilation

    if pixels == 0:
        return mask.copy()
    grown, box = np.zeros_like(mask), mask_box(mask, pixels)
    grown[box] = binary_dilation(mask[box], iterations=pixels)
    return grown


def opened(mask: Mask, pixels: int) -> Mask:
    """A mask (H, W) without what is narrower than `pixels` steps along rows and columns to each
    side."""
    from scipy.ndimage import binary_opening

    if pixels == 0:
        return mask.copy()
    found, box = np.zeros_like(mask), mask_box(mask, 0)
    found[box] = binary_opening(mask[box], iterations=pixels)
    return found
