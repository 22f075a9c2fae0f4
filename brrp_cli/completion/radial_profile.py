"""What is seen as if it were round about an upright axis: its outer and its inner radius at each
height. The wall of a bowl lies between them, whichever part of it is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RadialProfile:
    """outer, inner : (levels,) metres, from `low` to `high` metres; inner is 0 where nothing is
    seen that faces the axis."""

    low: float
    high: float
    outer: Array
    inner: Array

    def radii(self, heights: Array) -> tuple[Array, Array]:
        """Outer and inner radius (n,) at heights (n,), metres."""
        at = np.linspace(self.low, self.high, len(self.outer))
        return np.interp(heights, at, self.outer), np.interp(heights, at, self.inner)


def radial_profile(heights: Array, radii: Array, outward: Array, levels: int) -> RadialProfile:
    """Of points (n,) at these heights and distances from the axis, metres; outward : (n,) of their
    normals, along the direction away from the axis."""
    low, high = float(heights.min()), float(max(heights.max(), heights.min() + 1e-3))
    level = np.rint((heights - low) / (high - low) * (levels - 1)).astype(np.int64)
    facing = outward < 0
    outer = _means(level[~facing], radii[~facing], levels)
    inner = _means(level[facing], radii[facing], levels)
    if np.isnan(outer).all():
        outer = _means(level, radii, levels)
    return RadialProfile(low, high, _filled(outer), _gone(inner))


def _means(level: NDArray[np.int64], values: Array, levels: int) -> Array:
    count = np.bincount(level, minlength=levels)
    sums = np.bincount(level, values, minlength=levels)
    return np.where(count > 0, sums / np.maximum(count, 1), np.nan)


def _filled(values: Array) -> Array:
    """Gaps take what lies between, or the nearest end."""
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), known, values[known])


def _gone(values: Array) -> Array:
    """Gaps between are filled; under and over all that is known there is nothing."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return np.zeros(len(values))
    return np.interp(np.arange(len(values)), known, values[known], left=0.0, right=0.0)
