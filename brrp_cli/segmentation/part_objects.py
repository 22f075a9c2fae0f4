"""What rises from the table, parted into objects by the affinities of its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.segmentation.agglomerate import borders_of, join_alike_pixels
from brrp_cli.segmentation.components import find_parts
from brrp_cli.segmentation.learned_affinities import affinities_in
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces


@dataclass(frozen=True)
class Parted:
    """labels : (H, W), 1, 2, ..., 0 = none; border : (H, W) 0 to 1, that one thing ends there;
    object : (H, W) probability that a pixel shows one"""

    labels: NDArray[np.int64]
    border: NDArray[np.float64]
    object: NDArray[np.float32]


def part_objects(
    frame: Frame,
    seen: SeenSurfaces,
    risen: NDArray[np.bool_],
    config: SegmentConfig,
) -> Parted:
    """Objects in what has `risen` (H, W) from the table, without what the network takes for depth
    that bled."""
    own = config.affinities
    affinities = affinities_in(frame, seen, config)
    mask = affinities.sample(risen) & (affinities.object > own.least)
    border = borders_of(affinities)
    parts = find_parts(mask, border, own.components)
    depth = affinities.sample(seen.depth)
    labels = affinities.restore(join_alike_pixels(parts, affinities, depth, own))
    return Parted(
        np.where(risen, labels, 0),
        affinities.restore(border),
        affinities.restore(affinities.object),
    )
