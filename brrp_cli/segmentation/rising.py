"""What rises from the table, and by how much something must to be more than its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_image
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Rising:
    """Pixels (H, W) on the table: those that have `risen` from it, those that may be the `rim` of
    such, and all but what lies below it. lift : (H, W) metres above which something has risen"""

    risen: Mask
    rim: Mask
    floor: Mask
    lift: NDArray[np.float64]

    def without(self, away: Mask) -> Rising:
        """The same, where pixels that are `away` (H, W) do not rise."""
        return Rising(self.risen & ~away, self.rim & ~away, self.floor & ~away, self.lift)


@kept_for_last_image
def rising_in(_frame: Frame, seen: SeenSurfaces, config: SegmentConfig) -> Rising:
    """What rises in a frame of which these surfaces were seen."""
    return rising(seen, config)


def rising(seen: SeenSurfaces, config: SegmentConfig) -> Rising:
    """What rises in a frame."""
    lift = _lift(seen.height, seen.depth, config)
    on_table = seen.beside <= config.margin
    on_table[on_table] = ~seen.table.bin_walls(
        seen.plan[on_table], seen.height[on_table], config.bins
    )
    with np.errstate(invalid="ignore"):
        return Rising(
            on_table & (seen.height > lift),
            on_table & (seen.height > config.rim * lift),
            on_table & (seen.height > -config.max_height),
            lift,
        )


def _lift(
    height: NDArray[np.float64], depth: NDArray[np.float64], config: SegmentConfig
) -> NDArray[np.float64]:
    """(H, W) metres above which something has risen from the table at its depth (H, W)."""
    depth = np.nan_to_num(depth, nan=float(np.nanmedian(depth)))
    most = config.max_height * np.maximum(depth / config.far, 1.0) ** 2
    flat = np.abs(height) < most
    scaled = height[flat] / depth[flat] ** 2
    # The median of deviations, times what makes it the deviation of a normal distribution.
    deviation = 1.4826 * float(np.median(np.abs(scaled - np.median(scaled)))) if flat.any() else 0.0
    return np.clip(config.sigmas * deviation * depth**2, config.min_height, most)
