"""Uncertainty as colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Share of a scene's vertices whose spread lies under the top of the colour scale: a few vertices
# far from every sample would otherwise flatten everything else into one colour.
TOP_SHARE = 0.98


def logit_spread(variance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Standard deviation of the logits: what the colour scale shows, since it is less skewed."""
    return np.sqrt(np.asarray(variance, dtype=np.float64))


def scale_top(variances: list[NDArray[np.floating]]) -> float:
    """Top of one colour scale for all objects of a scene, as a spread; its bottom is 0."""
    if not variances:
        return 1.0
    return max(float(np.quantile(logit_spread(np.concatenate(variances)), TOP_SHARE)), 1e-6)


def uncertainty_colours(variance: NDArray[np.floating], top: float) -> NDArray[np.uint8]:
    """Colours (n, 4) RGBA of variances (n,): dark is sure, bright is unsure (viridis)."""
    from matplotlib import colormaps

    return np.asarray(colormaps["viridis"](logit_spread(variance) / top, bytes=True))
