"""The stored descriptors of one object, in bytes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.descriptors.colour_histogram import COLOUR_BINS
from brrp_cli.descriptors.point_pairs import PAIR_BINS


@dataclass(frozen=True)
class Appearance:
    """One object from all around.

    colour : (v, COLOUR_BINS) uint8 and pairs : (v, PAIR_BINS) uint8, histograms of each view as
    `to_bytes` makes them; colour is all 0 for a mesh without colours
    sizes : (r, 3) float32, metres, height and footprint in each resting pose
    """

    colour: NDArray[np.uint8]
    pairs: NDArray[np.uint8]
    sizes: NDArray[np.float32]

    def __post_init__(self) -> None:
        views = len(self.colour)
        assert self.colour.shape == (views, COLOUR_BINS)
        assert self.pairs.shape == (views, PAIR_BINS)
        assert self.sizes.shape[1:] == (3,)


def to_bytes(histograms: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Square roots of histograms (..., b), sum 1, as 0 to 255."""
    return np.rint(255 * np.sqrt(histograms)).astype(np.uint8)


def roots(stored: NDArray[np.uint8]) -> NDArray[np.float32]:
    """What `to_bytes` stored, as square roots: the dot product of two is Bhattacharyya's
    coefficient, 1 for histograms that are the same."""
    return stored.astype(np.float32) / np.float32(255)
