"""Pixels of an image, and their partners at an offset.

Near partners tell borders, far ones what belongs together beyond a border that prints, shadows or
waves of depth have drawn (Wolf et al., "The Mutex Watershed", ECCV 2018).
"""

from __future__ import annotations

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
