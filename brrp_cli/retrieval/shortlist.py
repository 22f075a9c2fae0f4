"""Which objects of a large prior are looked at closely: one product with a mean of each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.retrieval.belief import NEUTRAL_COLOUR, WEIGHTS
from brrp_cli.retrieval.likeness import size_penalty
from brrp_cli.retrieval.seen import SeenObject

# Every object is looked at closely in a prior of this size or less.
CLOSELY = 256
# So many are kept by colour and shape, of which `CLOSELY` are kept by size too.
ROUGHLY = 2_000
# Every so many-th light will do for a first look.
LIGHT_STEP = 8
_CHUNK = 1_000


class Shortlist:
    """Mean descriptors of all objects, kept in memory: about 1 kB for each."""

    def __init__(self, table: NDArray[Any]) -> None:
        self._table = table
        self._all = np.arange(len(table))
        self._colour = self._pairs = np.zeros((0, 0), np.float32)
        if len(table) > CLOSELY:
            self._colour, self._pairs = _mean_roots(table, "colour"), _mean_roots(table, "pairs")
            self._plain = ~self._colour.any(axis=1)

    def rows(self, seen: SeenObject, histograms: NDArray[np.floating] | None) -> NDArray[np.int64]:
        """Rows (m,) of the table that are to be looked at, ascending."""
        if len(self._all) <= CLOSELY:
            return self._all
        score = np.zeros(len(self._all), np.float32)
        if histograms is not None:
            lit = np.sqrt(histograms[::LIGHT_STEP], dtype=np.float32)
            colour = (self._colour @ lit.T).max(axis=1)
            colour[self._plain] = NEUTRAL_COLOUR
            score += np.float32(WEIGHTS.colour) * colour
        if seen.pairs is not None:
            pairs = self._pairs @ np.sqrt(seen.pairs, dtype=np.float32)
            score += np.float32(WEIGHTS.pairs * (1 - seen.hidden)) * pairs
        rough = _best(score, ROUGHLY)
        sizes = self._table["sizes"][rough]
        size = np.float32(WEIGHTS.size) * size_penalty(seen.size, sizes, seen.hidden)
        return np.sort(rough[_best(score[rough] + size, CLOSELY)])


def _best(score: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    if len(score) <= count:
        return np.arange(len(score))
    return np.asarray(np.argpartition(-score, count)[:count])


def _mean_roots(table: NDArray[Any], field: str) -> NDArray[np.float32]:
    """Mean over views of the stored square roots (n, b), unit length; 0 where there is none."""
    parts = [
        table[field][start : start + _CHUNK].mean(axis=1, dtype=np.float32)
        for start in range(0, len(table), _CHUNK)
    ]
    mean = np.concatenate(parts)
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.asarray(mean / np.where(length > 0, length, 1.0))
