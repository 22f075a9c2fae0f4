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
    # Asked about few points: a tree that is made quickly.
    tree = spatial.cKDTree(points[labels > 0], balanced_tree=False, compact_nodes=False)
    _, nearest = tree.query(points[free], distance_upper_bound=reach)
    grown = labels.copy()
    grown[free] = np.append(labels[labels > 0], 0)[nearest]
    return grown


def fill_holes(labels: NDArray[np.int64], missing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Labels (H, W) in which pixels without depth that one label encloses have that label.

    missing : (H, W) pixels without depth
    """
    ndimage = import_library("scipy.ndimage")
    holes, count = ndimage.label(missing & (labels == 0))
    beside, many = [], int(labels.max()) + 1
    for axis in (0, 1):
        hole, label = np.moveaxis(holes, axis, 0), np.moveaxis(labels, axis, 0)
        for near, far in ((np.s_[1:], np.s_[:-1]), (np.s_[:-1], np.s_[1:])):
            ring = (hole[near] > 0) & (hole[far] == 0)
            beside.append(hole[near][ring] * many + label[far][ring])
    # The image's border is like a label of its own, and so is the background.
    for edge in (holes[0], holes[-1], holes[:, 0], holes[:, -1]):
        beside.append(edge.astype(np.int64) * many)
    # Each pair of a hole and a label beside it, once.
    hole, label = np.divmod(np.unique(np.concatenate(beside)), many)
    labels_beside = np.bincount(hole, minlength=count + 1)
    fill = np.zeros(count + 1, dtype=np.int64)
    alone = (labels_beside[hole] == 1) & (hole > 0)
    fill[hole[alone]] = label[alone]
    return np.where(holes > 0, fill[holes], labels)
