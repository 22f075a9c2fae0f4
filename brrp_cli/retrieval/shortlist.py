"""Which objects of a large prior are looked at closely: one product with a mean of each.

Objects with and without colours are chosen apart from each other: a colour in light that is not
known is never quite alike, and many meshes without colours would crowd out the right one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import RetrievalConfig
from brrp_cli.prior.appearance_index import AppearanceSummary
from brrp_cli.retrieval.observed_appearance import ObservedAppearance
from brrp_cli.retrieval.similarity import size_penalty

_CHUNK = 1_000


class Shortlist:
    """A first look at all objects."""

    def __init__(self, first: AppearanceSummary, config: RetrievalConfig) -> None:
        self._config = config
        self._first = first
        self._all = np.arange(len(first.colour))
        self.plain = np.asarray(~first.colour.any(axis=1), dtype=np.bool_)

    def rows(
        self, seen: ObservedAppearance, histograms: NDArray[np.floating] | None
    ) -> NDArray[np.int64]:
        """Rows (m,) of the table that are to be looked at, ascending."""
        own, weights = self._config.shortlist, self._config.likeness
        plain = self._config.similarity.plain_colour
        if len(self._all) <= own.closely:
            return self._all
        score = np.zeros(len(self._all), np.float32)
        if histograms is not None:
            lit = np.sqrt(histograms[:: own.light_step], dtype=np.float32)
            colour = _best_alike(self._first.colour, lit)
            colour[self.plain] = plain
            score += np.float32(weights.colour) * colour
        if seen.pairs is not None:
            pairs = _best_alike(self._first.pairs, np.sqrt(seen.pairs, dtype=np.float32)[None])
            score += np.float32(weights.pairs * (1 - seen.hidden)) * pairs
        return best_of_each(self.plain, lambda kind: self._best_rows(seen, score, kind))

    def _best_rows(
        self, seen: ObservedAppearance, score: NDArray[np.float32], kind: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Those of the rows `kind` that are to be looked at, by scores (n,) without size."""
        own = self._config.shortlist
        rough = kind[_best(score[kind], own.roughly)]
        sizes = self._first.sizes[rough]
        against = size_penalty(seen.size, sizes, seen.hidden, self._config.similarity)
        size = np.float32(self._config.likeness.size) * against
        return rough[_best(score[rough] + size, own.closely)]


def best_of_each(
    plain: NDArray[np.bool_], best: Callable[[NDArray[np.int64]], NDArray[np.int64]]
) -> NDArray[np.int64]:
    """What `best` takes of the objects without colours and of the others, ascending.

    plain : (n,) which objects have no colours; best : from some of 0 to n - 1, the best of them
    """
    return np.sort(np.concatenate([best(kind) for kind in kinds(plain)]))


def kinds(plain: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Which objects have no colours, and which have, of those that are `plain` (n,) and the others;
    no kind without any."""
    both = (np.flatnonzero(plain), np.flatnonzero(~plain))
    return [kind for kind in both if len(kind)]


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
