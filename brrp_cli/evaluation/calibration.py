"""Metrics of probabilities: are they right as often as they say, and does doubt rank error?

An empty set of points has no value: NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.floating]
Labels = NDArray[np.bool_]

CLIP = 1e-6


def brier(probability: Values, label: Labels) -> float:
    """Mean squared difference between probability (n,) and what was the case (n,) (Brier 1950)."""
    if len(probability) == 0:
        return float("nan")
    return float(np.mean((probability.astype(np.float64) - label) ** 2))


def negative_log_likelihood(probability: Values, label: Labels, clip: float = CLIP) -> float:
    """Mean of -ln P(label), nats. Probabilities are clipped to [clip, 1 - clip], so that one
    certain mistake costs at most -ln(clip): 13.8 nats with the default 1e-6.
    """
    if len(probability) == 0:
        return float("nan")
    clipped = np.clip(probability.astype(np.float64), clip, 1 - clip)
    return float(-np.mean(np.log(np.where(label, clipped, 1 - clipped))))


@dataclass(frozen=True)
class Reliability:
    """A reliability diagram over bins of equal width; empty bins have NaN.

    edges : (b + 1,); count : (b,) points in each bin
    confidence : (b,) mean probability; frequency : (b,) share of positive labels
    """

    edges: NDArray[np.float64]
    count: NDArray[np.int64]
    confidence: NDArray[np.float64]
    frequency: NDArray[np.float64]


def reliability(probability: Values, label: Labels, bins: int = 10) -> Reliability:
    """Sort (n,) probabilities of the positive label into bins. A value on an edge belongs to the
    upper bin; 1 belongs to the last.
    """
    edges = np.linspace(0, 1, bins + 1)
    which = np.clip(np.searchsorted(edges, probability, side="right") - 1, 0, bins - 1)
    count = np.bincount(which, minlength=bins)
    filled = np.where(count > 0, count, np.nan)
    return Reliability(
        edges=edges,
        count=count,
        confidence=np.bincount(which, weights=probability, minlength=bins) / filled,
        frequency=np.bincount(which, weights=label, minlength=bins) / filled,
    )


def expected_calibration_error(probability: Values, label: Labels, bins: int = 10) -> float:
    """Mean over points of |frequency - confidence| of their bin (Naeini et al., AAAI 2015)."""
    if len(probability) == 0:
        return float("nan")
    diagram = reliability(probability, label, bins)
    gap = np.abs(diagram.frequency - diagram.confidence)
    return float(np.nansum(gap * diagram.count) / diagram.count.sum())


def sparsification(error: Values, ranking: Values) -> NDArray[np.float64]:
    """Mean error (n,) of what remains after the k highest-ranked of n points are removed, k = 0 to
    n - 1, over the mean error of all.

    Points of equal rank are removed in random order; the curve is the expectation over that order,
    so that the order of the input does not matter.
    """
    _, group, size = np.unique(-ranking, return_inverse=True, return_counts=True)
    expected = np.bincount(group, weights=error) / size
    removed_first = np.sort(group)
    remaining = np.cumsum(expected[removed_first][::-1])[::-1]
    left = np.arange(len(error), 0, -1)
    return np.asarray(remaining / left / np.mean(error))


def ause(error: Values, uncertainty: Values) -> float:
    """Area under the sparsification error: between the curve ranked by uncertainty (n,) and the one
    ranked by the error (n,) itself (Ilg et al., ECCV 2018). 0 is a perfect ranking.

    0 where there is no error to rank; NaN without points.
    """
    if len(error) == 0:
        return float("nan")
    from scipy.integrate import trapezoid

    error = np.asarray(error, dtype=np.float64)
    if not error.any():
        return 0.0
    gap = sparsification(error, uncertainty) - sparsification(error, error)
    return float(trapezoid(gap, dx=1 / len(error)))
