"""Pixels of an image and their partners at an offset."""

from __future__ import annotations


def windows(
    offset: tuple[int, int], shape: tuple[int, ...]
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The pixels of an image (h, w) that have a partner `offset` from them, and those partners."""
    (rows, other_rows), (columns, other_columns) = (
        (slice(max(-step, 0), size - max(step, 0)), slice(max(step, 0), size + min(step, 0)))
        for step, size in zip(offset, shape, strict=True)
    )
    return (rows, columns), (other_rows, other_columns)
