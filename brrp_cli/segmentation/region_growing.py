"""Masks that take in what lies next to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library


def grow(
    labels: NDArray[np.int64],
    points: NDArray[np.floating],
    candidates: NDArray[np.bool_],
    reach: float,
) -> NDArray[np.int64]:
    """Labels (H, W) after each unlabelled candidate took the label of the nearest labelled point.

    points : (H, W, 3) metres; no point is nearer than `reach`: the candidate stays 0.
    """
    spatial = import_library("scipy.spatial")
    free = candidates & (labels == 0)
    if not labels.any() or not free.any():
        return labels
    _, nearest = spatial.cKDTree(points[labels > 0]).query(points[free], distance_upper_bound=reach)
    grown = labels.copy()
    grown[free] = np.append(labels[labels > 0], 0)[nearest]
    return grown


def fill_holes(labels: NDArray[np.int64], missing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Labels (H, W) in which pixels without depth that one label encloses have that label.

    missing : (H, W) pixels without depth
    """
    ndimage = import_library("scipy.ndimage")
    filled = labels.copy()
    holes, count = ndimage.label(missing & (labels == 0))
    for hole, window in enumerate(ndimage.find_objects(holes, max_label=count), start=1):
        around = tuple(slice(max(cut.start - 1, 0), cut.stop + 1) for cut in window)
        inside = holes[around] == hole
        ring = ndimage.binary_dilation(inside) & ~inside
        touched = np.unique(labels[around][ring])
        on_border = any(
            cut.start == 0 or cut.stop == size
            for cut, size in zip(window, labels.shape, strict=True)
        )
        if len(touched) == 1 and touched[0] > 0 and not on_border:
            filled[around][inside] = touched[0]
    return filled
