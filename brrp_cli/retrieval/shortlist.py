"""Which objects of a large prior are looked at closely: one product with a mean of each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.prior.appearance_index import AppearanceSummary
from brrp_cli.retrieval.observed_appearance import SeenObject
from brrp_cli.retrieval.score_fusion import NEUTRAL_COLOUR, WEIGHTS
from brrp_cli.retrieval.similarity import size_penalty

# Every object is looked at closely in a prior of this size or less.
CLOSELY = 256
# So many are kept by colour and shape, of which `CLOSELY` are kept by size too.
ROUGHLY = 2_000
# Every so many-th light will do for a first look.
LIGHT_STEP = 8
_CHUNK = 1_000


class Shortlist:
    """A first look at all objects."""

    def __init__(self, first: AppearanceSummary) -> None:
        self._first = first
        self._all = np.arange(len(first.colour))
        self._plain = ~first.colour.any(axis=1)

    def rows(self, seen: SeenObject, histograms: NDArray[np.floating] | None) -> NDArray[np.int64]:
        """Rows (m,) of the table that are to be looked at, ascending."""
        if len(self._all) <= CLOSELY:
            return self._all
        score = np.zeros(len(self._all), np.float32)
        if histograms is not None:
            lit = np.sqrt(histograms[::LIGHT_STEP], dtype=np.float32)
            colour = _best_alike(self._first.colour, lit)
            colour[self._plain] = NEUTRAL_COLOUR
            score += np.float32(WEIGHTS.colour) * colour
        if seen.pairs is not None:
            pairs = _best_alike(self._first.pairs, np.sqrt(seen.pairs, dtype=np.float32)[None])
            score += np.float32(WEIGHTS.pairs * (1 - seen.hidden)) * pairs
        rough = _best(score, ROUGHLY)
        sizes = self._first.sizes[rough]
        size = np.float32(WEIGHTS.size) * size_penalty(seen.size, sizes, seen.hidden)
        return np.sort(rough[_best(score[rough] + size, CLOSELY)])


def _best(score: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    if len(score) <= count:
        return np.arange(len(score))
    return np.asarray(np.argpartition(-score, count)[:count])


def _best_alike(means: NDArray[np.uint8], roots: NDArray[np.float32]) -> NDArray[np.float32]:
    """Largest product (n,) of means (n, b), of length 255, with any of roots (m, b)."""
    # In parts, so that what is converted stays in the processor's cache.
    parts = range(0, len(means), _CHUNK)
    found = [(means[i : i + _CHUNK].astype(np.float32) @ roots.T).max(axis=1) for i in parts]
    return np.asarray(np.concatenate(found) / np.float32(255), dtype=np.float32)
