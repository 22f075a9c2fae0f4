"""Parts of the image that boundaries enclose, and which of them are one thing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import ComponentsConfig
from brrp_cli.dependencies import import_library


def find_parts(
    mask: NDArray[np.bool_], boundary: NDArray[np.float64], config: ComponentsConfig
) -> NDArray[np.int64]:
    """Labels (H, W), 1, 2, ..., of parts of the mask: each grows from a calm middle to the ridges
    of the boundary (H, W), 0 to 1. What no middle grows into is one part if it hangs together, and
    0 if it is smaller than a middle, too."""
    ndimage = import_library("scipy.ndimage")
    segmentation = import_library("skimage.segmentation")
    calm = mask & (boundary < config.calm)
    # A bridge of one or two pixels between things is noise.
    cores = _large(
        ndimage.label(ndimage.binary_erosion(calm, border_value=1))[0], config.least_core
    )
    grown = np.asarray(segmentation.watershed(boundary, cores, mask=mask), dtype=np.int64)
    # Thin things have no pixel that is far from an edge, and may touch others by a corner alone.
    left, _ = ndimage.label(mask & (grown == 0), structure=np.ones((3, 3)))
    thin = _large(left, config.least_core)
    return np.where(thin > 0, thin + cores.max(), grown)


def split_at_strongest(
    parts: NDArray[np.int64], boundary: NDArray[np.float64], pieces: int
) -> NDArray[np.int64]:
    """Labels (H, W) of that many parts, or of fewer where there are no more: neighbours are joined,
    the weakest border first, and then the smallest with whatever is nearest in number."""
    while (count := len(np.unique(parts[parts > 0]))) > pieces:
        border, length = _borders(parts, boundary)
        if length.any():
            mean = np.where(length > 0, border / np.maximum(length, 1), np.inf)
            first, second = (int(i) for i in np.unravel_index(np.argmin(mean), mean.shape))
        else:
            labels, sizes = np.unique(parts[parts > 0], return_counts=True)
            first, second = (int(i) for i in labels[np.argsort(sizes, kind="stable")[[1, 0]]])
        parts = np.where(parts == second, first, parts)
        assert len(np.unique(parts[parts > 0])) == count - 1
    return parts


def absorb_small(
    parts: NDArray[np.int64], boundary: NDArray[np.float64], small: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Labels (H, W) after each part that is `small` (n + 1,) joined the large one with which it
    has the longest border that is not all boundary; without one it stays."""
    border, length = _borders(parts, boundary)
    open_border = (length - border) + (length - border).T
    open_border[:, small] = 0.0
    table = np.arange(len(small))
    for i in np.flatnonzero(small):
        best = int(np.argmax(open_border[i]))
        if i > 0 and open_border[i, best] >= 1:
            table[i] = best
    return table[parts]


def relabel(parts: NDArray[np.int64], same: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Labels (H, W) in which those that `same` (n + 1, n + 1) connects are one; 0 stays 0."""
    csgraph = import_library("scipy.sparse.csgraph")
    same = same | same.T
    same[0] = same[:, 0] = False
    _, group = csgraph.connected_components(same, directed=False)
    present = np.unique(parts[parts > 0])
    table = np.zeros(parts.max() + 1, dtype=np.int64)
    table[present] = np.unique(group[present], return_inverse=True)[1].reshape(-1) + 1
    return table[parts]


def _borders(
    parts: NDArray[np.int64], boundary: NDArray[np.floating]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sum of the boundary along, and pixels of, every two parts' common border: (n + 1, n + 1)."""
    count = int(parts.max()) + 1
    border, length = np.zeros((count, count)), np.zeros((count, count))
    for axis in (0, 1):
        first, second = (np.moveaxis(parts, axis, 0)[cut] for cut in (np.s_[1:], np.s_[:-1]))
        strength = np.moveaxis(boundary, axis, 0)
        strength = np.maximum(strength[1:], strength[:-1])
        meet = (first != second) & (first > 0) & (second > 0)
        low, high = np.minimum(first, second)[meet], np.maximum(first, second)[meet]
        np.add.at(border, (low, high), strength[meet])
        np.add.at(length, (low, high), 1.0)
    return border, length


def _large(labels: NDArray[np.integer], least: int) -> NDArray[np.int64]:
    small = np.bincount(labels.ravel()) < least
    return np.where(small[labels], 0, labels).astype(np.int64)
