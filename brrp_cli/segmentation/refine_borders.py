"""Borders of masks moved to where colour changes: depth bleeds over silhouettes, colour does not.

Around each object a band of pixels is uncertain. What lies deeper inside tells the object's
colours, what lies farther outside the table's; a pixel of the band goes to the side whose colours
it has. Where both have the same colours, depth's answer stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import BordersConfig
from brrp_cli.dependencies import import_library
from brrp_cli.frames.dilate import widened

Mask = NDArray[np.bool_]


def refine_borders(
    segmap: NDArray[np.int64], rgb: NDArray[np.uint8], doubtful: Mask, config: BordersConfig
) -> NDArray[np.int64]:
    """Masks (H, W) of which each has lost what is coloured as the background around it, and gained
    what is coloured as itself, within `config.outer` pixels of its border.

    rgb : (H, W, 3); doubtful : (H, W) pixels of masks that are as uncertain as the band
    Borders between two objects stay.
    """
    ndimage = import_library("scipy.ndimage")
    codes = _colours(rgb, config.levels)
    refined = segmap.copy()
    empty = segmap == 0
    for object_id, box in enumerate(ndimage.find_objects(segmap), start=1):
        if box is None:
            continue
        window = widened(box, config.ring)
        mask, free = segmap[window] == object_id, empty[window]
        # Pixels of other objects are neither: borders with them stay.
        inner = ndimage.distance_transform_edt(~free)
        inner[~mask] = 0.0
        sure = mask & ~doubtful[window] & (inner > min(config.inner, 0.5 * inner.max()))
        outer = ndimage.distance_transform_edt(~mask)
        clear = ndimage.distance_transform_edt(free) > config.outer
        around = clear & (outer <= config.ring)
        if sure.sum() < config.least or around.sum() < config.least:
            continue
        says = _log_ratio(codes[window], sure, around, config)
        says += np.where(mask, config.depth, -config.depth)
        band = (mask & ~sure) | (free & (outer <= config.outer) & ~clear)
        found = sure | (band & (says > 0)) | (mask & ~band)
        # One piece with what is sure, without specks.
        found = ndimage.binary_opening(found, iterations=1) | sure
        pieces, _ = ndimage.label(found)
        found = np.isin(pieces, np.unique(pieces[sure]))
        found = mask & ndimage.binary_fill_holes(found) | found
        target = refined[window]
        target[mask & ~found] = 0
        target[found & free & (target == 0)] = object_id
    return refined


def _colours(rgb: NDArray[np.uint8], levels: int) -> NDArray[np.int64]:
    """(H, W) numbers of colours (H, W, 3) in so many levels."""
    ndimage = import_library("scipy.ndimage")
    smooth = ndimage.uniform_filter(rgb, size=(3, 3, 1))
    level = (np.arange(256) * levels // 256)[smooth]
    return np.asarray((level[..., 0] * levels + level[..., 1]) * levels + level[..., 2])


def _log_ratio(
    codes: NDArray[np.int64], inside: Mask, outside: Mask, config: BordersConfig
) -> NDArray[np.float64]:
    """(H, W) log of how much likelier each pixel's colour is inside than outside."""
    ndimage = import_library("scipy.ndimage")
    shares = []
    for mask in (inside, outside):
        count = np.bincount(codes[mask], minlength=config.levels**3).astype(np.float64)
        count = count.reshape((config.levels,) * 3)
        count = ndimage.gaussian_filter(count, config.blur, mode="constant")
        shares.append(count / count.sum() + config.floor)
    ratio = np.log(shares[0] / shares[1]).ravel()[codes]
    return np.asarray(ndimage.gaussian_filter(ratio, 1.0))
