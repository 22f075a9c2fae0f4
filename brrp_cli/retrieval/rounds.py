"""Which stored objects are laid over what is seen: those that look most alike, then those that a
glance at all of them finds, until one is found."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import RetrievalConfig
from brrp_cli.retrieval.placed_objects import PlacedObjects
from brrp_cli.retrieval.score_fusion import Similarity, by_shape, looks_difference
from brrp_cli.retrieval.shortlist import kinds

Rows = NDArray[np.int64]
Nats = NDArray[np.float64]


def alike(likely: NDArray[np.float64], margin: float) -> Rows:
    """Those of objects (m,) whose likeness is less than the best one's by `margin` nats at most,
    the most likely first."""
    order = np.argsort(-likely, kind="stable")
    return order[likely[order] > likely.max() * np.exp(-margin)]


class Rounds:
    """The rounds for one seen object.

    placed : what became of stored objects (m,); look : how alike these are to it; likely : (m,)
    their probabilities by that; plain : (m,) which of them have no colours
    """

    def __init__(
        self,
        placed: PlacedObjects,
        look: Similarity,
        likely: NDArray[np.float64],
        plain: NDArray[np.bool_],
        config: RetrievalConfig,
    ) -> None:
        self._placed = placed
        self._plain = plain
        self._config = config
        self._left = alike(likely, config.alignment.margin)
        looks = np.log(np.maximum(likely, np.finfo(float).tiny))
        # With the weights that decide in the end.
        self._counted = looks + looks_difference(look, config.likeness, config.fusion)
        self._shape = by_shape(look, config.likeness)
        self._sure = look.points / (look.points + config.fusion.points)

    def run(self, hasty: bool) -> None:
        """All rounds; in haste, the first. Then the best are placed once more."""
        own = self._config.alignment
        if not self._ends(self._of_each_kind(self._left, 0, own.tried)) and not hasty:
            ranked = self._at_a_glance()
            for begin, end in pairwise([0, *np.cumsum(own.glanced).tolist()]):
                if self._ends(self._of_each_kind(ranked, begin, end)):
                    break
        promise = self._counted + own.first * self._placed.agreed
        promise[self._placed.alignment <= own.lowest] = -np.inf
        last = np.argsort(-promise, kind="stable")[: own.last]
        self._placed.finish(np.sort(last[np.isfinite(promise[last])]))

    def _at_a_glance(self) -> Rows:
        """Those left, the most probable after a glance first."""
        left = np.sort(self._left)
        promise = self._counted[left] + self._config.alignment.first * self._placed.glances(left)
        return left[np.argsort(-promise, kind="stable")]

    def _of_each_kind(self, ranked: Rows, begin: int, end: int) -> Rows:
        """With and without colours, from one to another of each. In the prior's order, in which
        shards hold them."""
        chosen = [ranked[kind[begin:end]] for kind in kinds(self._plain[ranked])]
        return np.sort(np.concatenate([np.zeros(0, np.int64), *chosen]))

    def _ends(self, rows: Rows) -> bool:
        """Try some (r,); whether the rounds end with them."""
        own, placed = self._config.alignment, self._placed
        self._left = self._left[~np.isin(self._left, rows)]
        promise = self._counted[rows] + own.first * placed.tried(rows)
        order = rows[np.argsort(-promise, kind="stable")]
        for chosen in (order[: own.most], order[own.most : own.most + own.more]):
            placed.refine(chosen)
            if self._found():
                return True
        # With a score of 1, the best there is, none of those left would be the most probable.
        most = self._counted[self._left].max(initial=-np.inf) + self._config.fusion.alignment
        return bool(self._agreed().max() > most)

    def _found(self) -> bool:
        """Whether the best is right for all that speaks against it, and stands out."""
        from scipy.special import softmax

        own, weight = self._config.alignment, self._config.fusion.alignment
        total = self._agreed(self._sure)
        best = int(total.argmax())
        unlike = weight * (1 - self._placed.agreed[best]) - self._shape[best]
        return bool(unlike <= own.certain and softmax(total)[best] >= own.distinct)

    def _agreed(self, sure: float = 1.0) -> Nats:
        return self._counted + sure * self._config.fusion.alignment * self._placed.agreed
