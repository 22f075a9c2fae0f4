"""Things stacked flush: one plain colour below, another above, and no step in depth between them.

Packages are printed in many colours, so that colour alone splits nothing. What is split has two
sides of which each is plain, which meet at one height over their whole width.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import StacksConfig
from brrp_cli.dependencies import import_library


def split_stacks(
    parts: NDArray[np.int64],
    rgb: NDArray[np.uint8],
    height: NDArray[np.floating],
    config: StacksConfig,
) -> NDArray[np.int64]:
    """Labels (H, W) in which the upper of two plain things stacked flush has a label of its own.

    parts : (H, W), 0 = background; rgb : (H, W, 3); height : (H, W) metres above the table
    """
    ndimage = import_library("scipy.ndimage")
    colour = import_library("skimage.color")
    split = parts.copy()
    for label, window in enumerate(ndimage.find_objects(parts), start=1):
        if window is None:
            continue
        mask = (parts[window] == label) & np.isfinite(height[window])
        if not mask.any():
            continue
        lab = colour.rgb2lab(rgb[window][mask]) * [config.lightness, 1.0, 1.0]
        seam = seam_height(lab, height[window][mask], config)
        if seam is not None:
            upper = mask & (height[window] > seam)
            split[window][upper] = split.max() + 1
    return split


def seam_height(
    colours: NDArray[np.floating], height: NDArray[np.floating], config: StacksConfig
) -> float | None:
    """The height, metres, at which n pixels of one thing and of another above it meet; None where
    they are of one thing.

    The cut is where most of the variance of colour lies between both sides (Otsu's criterion, IEEE
    SMC 1979, over heights). colours : (n, 3); height : (n,) metres
    """
    low, high = np.percentile(height, (config.strays, 100 - config.strays))
    if high - low < 2 * config.least_height:
        return None
    bins = np.floor((height - low) / config.step).astype(np.int64)
    inside = (bins >= 0) & (height <= high)
    bins, colours = bins[inside], colours[inside]
    count = np.bincount(bins).astype(np.float64)
    sums = np.stack([np.bincount(bins, colours[:, i]) for i in range(3)], axis=-1)
    below, total = np.cumsum(count)[:-1], count.sum()
    above = total - below
    first, second = np.cumsum(sums, axis=0)[:-1], sums.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = first / below[:, None] - (second - first) / above[:, None]
    distance = np.linalg.norm(np.nan_to_num(apart), axis=-1)
    between = below * above / total**2 * distance**2
    cut = (np.arange(len(below)) + 1) * config.step
    allowed = (cut >= config.least_height) & (high - low - cut >= config.least_height)
    if not allowed.any():
        return None
    best = int(np.argmax(np.where(allowed, between, -1.0)))
    variance = float(colours.var(axis=0).sum())
    if distance[best] < config.apart or between[best] < config.plain * variance:
        return None
    # Of a lid on a shoulder, or of what lies on a wide thing, one side is much narrower.
    reach = max(1, round(config.beside / config.step))
    narrow, wide = sorted(
        (count[max(best + 1 - reach, 0) : best + 1].sum(), count[best + 1 : best + 1 + reach].sum())
    )
    return float(low + cut[best]) if narrow > config.width * wide else None
