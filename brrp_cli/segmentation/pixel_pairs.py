"""Pixels of an image, their partners at an offset, and the box around some of them.

Near partners tell borders, far ones what belongs together beyond a border that prints, shadows or
waves of depth have drawn (Wolf et al., "The Mutex Watershed", ECCV 2018).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Rows and columns from a pixel to its partner, in pixels of the network's image.
REACHES = (2, 6, 14, 32)
DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))
OFFSETS = tuple((reach * down, reach * right) for reach in REACHES for down, right in DIRECTIONS)


def windows(
    offset: tuple[int, int], shape: tuple[int, ...]
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The pixels of an image (h, w) that have a partner `offset` from them, and those partners."""
    (rows, other_rows), (columns, other_columns) = (
        (
            slice(min(max(-step, 0), size), max(size - max(step, 0), 0)),
            slice(min(max(step, 0), size), max(size + min(step, 0), 0)),
        )
        for step, size in zip(offset, shape, strict=True)
    )
    return (rows, columns), (other_rows, other_columns)


def box_of(mask: NDArray[np.bool_], margin: int = 0) -> tuple[slice, slice]:
    """Rows and columns that hold all pixels of a mask (h, w), and so many more on all sides; none
    of an empty one."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return np.s_[:0], np.s_[:0]
    (top, left), (low, right) = (
        np.maximum(np.array([rows[0], columns[0]]) - margin, 0),
        np.array([rows[-1], columns[-1]]) + margin + 1,
    )
    return np.s_[top:low], np.s_[left:right]
