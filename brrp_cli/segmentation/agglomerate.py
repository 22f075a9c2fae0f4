"""Parts that the affinities of their pixels join: average linkage, the most alike first.

Average linkage of signed graphs is one of the agglomerations of Bailoni et al., "GASP, a
generalized framework for agglomerative clustering of signed graphs" (CVPR 2022): one wrong border
among many right ones changes a mean by little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import AffinitiesConfig
from brrp_cli.frames.dilate import mask_box
from brrp_cli.segmentation.components import relabel
from brrp_cli.segmentation.learned_affinities import Affinities
from brrp_cli.segmentation.pixel_pairs import windows


def borders_of(affinities: Affinities) -> NDArray[np.float64]:
    """(h, w) 0 to 1, how surely one thing ends at a pixel: of the nearest partners alone."""
    reach = [max(abs(down), abs(right)) for down, right in affinities.offsets]
    border = np.zeros(affinities.object.shape)
    for same, offset, far in zip(affinities.same, affinities.offsets, reach, strict=True):
        if far == min(reach):
            pixel, _ = windows(offset, border.shape)
            middle = tuple(
                slice(cut.start + step // 2, cut.stop + step // 2)
                for cut, step in zip(pixel, offset, strict=True)
            )
            border[middle] = np.maximum(border[middle], 1 - same[pixel])
    return border


def join_alike_pixels(
    parts: NDArray[np.int64],
    affinities: Affinities,
    depth: NDArray[np.floating],
    config: AffinitiesConfig,
) -> NDArray[np.int64]:
    """Labels (h, w) after parts were joined, two at a time, those first whose pixels have the
    highest mean affinity, as long as it is over `config.alike`.

    depth : (h, w) metres, NaN where there is none. Two pixels with a step of more than
        `config.step` between them count as not alike, whatever the network says: where depth is
        missing around what stands in front, it sees no step.
    """
    count = int(parts.max()) + 1
    total, pairs = np.zeros((2, count * count))
    window = mask_box(parts > 0, 0)
    inside, depth = parts[window], depth[window]
    for same, offset in zip(affinities.same, affinities.offsets, strict=True):
        pixel, partner = windows(offset, inside.shape)
        first, second = inside[pixel], inside[partner]
        asked = (first > 0) & (second > 0) & (first != second)
        codes = first[asked] * count + second[asked]
        step = np.abs(depth[pixel][asked] - depth[partner][asked]) > config.step
        alike = np.where(step, 0, same[window][pixel][asked])
        total += np.bincount(codes, alike, count * count)
        pairs += np.bincount(codes, minlength=count * count)
    sums, numbers = total.reshape(count, count), pairs.reshape(count, count)
    return relabel(parts, _linked(sums + sums.T, numbers + numbers.T, config.alike))


def _linked(
    total: NDArray[np.float64], pairs: NDArray[np.float64], least: float
) -> NDArray[np.bool_]:
    """(n, n) which parts are joined. total : (n, n) sums of the affinities of `pairs` (n, n); both
    are used up"""
    joined = np.zeros(total.shape, dtype=bool)
    while True:
        mean = np.divide(total, pairs, out=np.zeros_like(total), where=pairs > 0)
        first, second = np.unravel_index(np.argmax(mean), mean.shape)
        if mean[first, second] <= least:
            return joined
        joined[first, second] = True
        for table in (total, pairs):
            table[first] += table[second]
            table[:, first] += table[:, second]
            table[second] = table[:, second] = table[first, first] = 0
