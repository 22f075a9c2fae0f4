"""Which objects a picture is to show whole: not those that lie far from all others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.reconstruction import Surface

# An object counts as far where its middle is further from the median one than this, metres, and
# than so many times the median distance: what a wrong mask made of a wall behind the table.
FAR, TIMES = 0.45, 3.0


def near_others(middles: NDArray[np.floating]) -> NDArray[np.bool_]:
    """(n,) bool of middles (n, 3), metres. At least half of them are near; of two both are."""
    if len(middles) < 3:
        return np.ones(len(middles), dtype=bool)
    distances = np.linalg.norm(middles - np.median(middles, axis=0), axis=1)
    return np.asarray(distances <= max(FAR, TIMES * float(np.median(distances))))


def shown_whole(surfaces: Sequence[Surface]) -> list[Surface]:
    """The surfaces that a picture is fitted to."""
    if not surfaces:
        return []
    boxes = [(s.vertices.min(axis=0) + s.vertices.max(axis=0)) / 2 for s in surfaces]
    return [s for s, near in zip(surfaces, near_others(np.array(boxes)), strict=True) if near]
