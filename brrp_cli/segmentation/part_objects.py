"""What may be object, parted into objects by the affinities of its pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import AffinitiesConfig
from brrp_cli.segmentation.agglomerate import Join, borders_of, joined, joins_of
from brrp_cli.segmentation.components import find_parts
from brrp_cli.segmentation.learned_affinities import affinities_of, shipped
from brrp_cli.segmentation.rising import Rising
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces


@dataclass(frozen=True)
class Parted:
    """parts : (H, W), 1, 2, ..., 0 = none; border : (H, W) 0 to 1, that one thing ends there;
    joins : of the parts, the surest first, also such as are not made"""

    parts: NDArray[np.int64]
    border: NDArray[np.float64]
    joins: Sequence[Join]

    def objects(self, alike: float) -> NDArray[np.int64]:
        """Labels (H, W) of what the joins of more than that affinity make of the parts."""
        return joined(self.parts, takewhile(lambda join: join.affinity > alike, self.joins))


def part_objects(
    rgb: NDArray[np.uint8], seen: SeenSurfaces, rises: Rising, config: AffinitiesConfig
) -> Parted:
    """Parts of what has risen from the table, where the network does not take it for depth that
    bled. rgb : (H, W, 3)"""
    affinities = affinities_of(rgb, seen, shipped(), config.colour)
    mask = affinities.sample(rises.risen) & (affinities.object > config.least)
    border = borders_of(affinities)
    parts = find_parts(mask, border, config.components)
    joins = joins_of(parts, affinities, config.doubtful)
    enlarged = np.where(rises.risen, affinities.enlarge(parts), 0)
    return Parted(enlarged, affinities.enlarge(border), joins)
