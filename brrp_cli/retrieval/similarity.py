"""How alike a seen object is to stored ones: colours, shape, size. Matrix products throughout."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import SimilarityConfig
from brrp_cli.descriptors.colour_histogram import AB_BINS, L_BINS, colour_histograms
from brrp_cli.descriptors.descriptor import roots
from brrp_cli.retrieval.observed_appearance import ObservedAppearance
from brrp_cli.retrieval.score_fusion import Similarity


def colour_likeness(
    histograms: NDArray[np.floating] | None,
    stored: NDArray[np.uint8],
    lights: int,
    config: SimilarityConfig,
    *,
    hueless: bool = False,
) -> NDArray[np.float32]:
    """Bhattacharyya coefficient (g, m) of the most similar view, for histograms (g, b) of what is
    seen in g lights and stored views (m, v, b); where either has no colours, `neutral_colour` or
    `plain_colour`. hueless : what is seen has no hue, so that lightness alone is compared"""
    count, views, bins = stored.shape
    if histograms is None:
        return np.full((lights, count), config.neutral_colour, np.float32)
    coloured = stored.any(axis=(1, 2))
    known = np.square(roots(stored[coloured].reshape(-1, bins)))
    if hueless:
        seen, known = lightness_alone(histograms), lightness_alone(known)
    else:
        seen, known = blurred(histograms, config.blur), blurred(known, config.blur)
    seen = np.sqrt(seen)
    alike = seen @ np.sqrt(known).T
    found = np.full((len(seen), count), config.plain_colour, np.float32)
    found[:, coloured] = alike.reshape(len(seen), -1, views).max(axis=-1, initial=0)
    # Many objects are as light: that one is says less for it.
    return found - np.float32(config.without_hue) if hueless else found


def lightness_alone(histograms: NDArray[np.floating]) -> NDArray[np.float32]:
    """Histograms (n, L_BINS) of lightness, of those (n, COLOUR_BINS) of colours."""
    by_lightness = histograms.astype(np.float32, copy=False).reshape(len(histograms), L_BINS, -1)
    return np.asarray(by_lightness.sum(axis=-1))


def blurred(histograms: NDArray[np.floating], share: float) -> NDArray[np.float32]:
    """Histograms (n, COLOUR_BINS) of which each bin has given `share` to either of its neighbours
    along a* and b*; what would leave the histogram stays."""
    kernel = np.diag(np.full(AB_BINS - 1, share, np.float32), 1)
    kernel = kernel + kernel.T
    kernel += np.diag(1 - kernel.sum(axis=0))
    both = np.kron(kernel, kernel).astype(np.float32)
    plain = histograms.astype(np.float32, copy=False).reshape(-1, AB_BINS**2)
    return np.asarray((plain @ both).reshape(histograms.shape))


def pair_likeness(
    histogram: NDArray[np.floating] | None, stored: NDArray[np.uint8], config: SimilarityConfig
) -> NDArray[np.float32]:
    """The same (m,) for the histogram over point pairs (b,) and stored views (m, v, b); not less
    than `least_pairs`."""
    if histogram is None:
        return np.full(len(stored), config.neutral_pairs, np.float32)
    alike = roots(stored) @ np.sqrt(histogram, dtype=np.float32)
    return np.asarray(np.maximum(alike.max(axis=-1), np.float32(config.least_pairs)))


def size_penalty(
    size: NDArray[np.floating] | None,
    stored: NDArray[np.float32],
    hidden: float,
    config: SimilarityConfig,
) -> NDArray[np.float32]:
    """What speaks against the size (m,), 0 or less, in the resting pose that fits best.

    size : (3,) seen height and footprint, metres; stored : (m, r, 3), NaN where there is no pose;
    hidden : share of the silhouette that ends at something in front. What is seen can be smaller
    than the object, the more so the more is hidden, but not larger.
    """
    if size is None:
        return np.zeros(len(stored), np.float32)
    allowed = np.array(config.size_spread, dtype=np.float32)
    spread = allowed + np.float32(config.size_share) * stored
    limit = np.float32(config.size_limit)
    off = (size.astype(np.float32) - stored) / spread
    larger = np.minimum(np.maximum(off, 0) ** 2, limit)
    weight = np.array(config.smaller, dtype=np.float32)
    smaller = np.minimum(np.maximum(-off, 0) ** 2 * weight, limit)
    against = (larger + np.float32((1 - hidden) ** 2) * smaller).sum(axis=-1)
    least = np.minimum(np.nanmin(against, axis=-1) / 2, np.float32(config.size_most))
    return np.asarray(-least, dtype=np.float32)


def similarity(
    seen: ObservedAppearance,
    histograms: NDArray[np.floating] | None,
    stored: NDArray[Any],
    rows: NDArray[np.int64],
    lights: int,
    config: SimilarityConfig,
) -> Similarity:
    """All of it for stored descriptors (m,), which are those of the rows (m,) of the prior."""
    return Similarity(
        rows=rows,
        colour=colour_likeness(histograms, stored["colour"], lights, config, hueless=seen.hueless),
        pairs=pair_likeness(seen.pairs, stored["pairs"], config),
        size=size_penalty(seen.size, stored["sizes"], seen.hidden, config),
        hidden=seen.hidden,
        points=len(seen.points),
    )


def lit_histograms(
    seen: ObservedAppearance, gains: NDArray[np.floating]
) -> NDArray[np.float32] | None:
    """Histograms (g, b) of the seen colours in each light; None without colours."""
    if seen.colours is None or seen.shares is None:
        return None
    return colour_histograms(seen.colours, seen.shares, gains)
