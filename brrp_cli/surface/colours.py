"""Uncertainty as colour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.reconstruction import METRES, Surface
from brrp_cli.surface.viridis import viridis

# Share of a scene's vertices whose spread lies under the top of the colour scale: a few vertices
# far from every sample would otherwise flatten everything else into one colour.
TOP_SHARE = 0.98


def spread(surface: Surface) -> NDArray[np.float64]:
    """Standard deviation (n,) at each vertex, which is what the colour scale shows: of the
    surface's place, metres, or of the logit, where the surface has its variance."""
    values = np.asarray(surface.uncertainty, dtype=np.float64)
    return values if surface.uncertainty_unit == METRES else np.sqrt(values)


def scale_top(surfaces: Sequence[Surface]) -> float:
    """Top of one colour scale for all surfaces of a scene, as a spread; its bottom is 0."""
    if not surfaces:
        return 1.0
    spreads = np.concatenate([spread(surface) for surface in surfaces])
    return max(float(np.quantile(spreads, TOP_SHARE)), 1e-6)


def spread_colours(spreads: NDArray[np.floating], top: float) -> NDArray[np.uint8]:
    """Colours (n, 4) RGBA of spreads (n,): dark is sure, bright is unsure (viridis)."""
    return viridis(np.asarray(spreads) / top)


def spread_meaning(surfaces: Sequence[Surface]) -> str:
    """What the spread of a scene's surfaces is a spread of."""
    return "the surface's place" if _in_metres(surfaces) else "the logits"


def spread_label(value: float, surfaces: Sequence[Surface]) -> str:
    """A spread as people read it on the colour scale."""
    return f"{value * 1000:.2g} mm" if _in_metres(surfaces) else f"{value:.2g}"


def _in_metres(surfaces: Sequence[Surface]) -> bool:
    return any(surface.uncertainty_unit == METRES for surface in surfaces)
