"""Which stored objects are laid over what is seen: those that look most alike, then those that a
glance at all of them finds, until one is found."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import RetrievalConfig
from brrp_cli.retrieval.placed_objects import PlacedObjects
from brrp_cli.retrieval.score_fusion import Similarity, by_shape, looks_difference

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
        # With the weights that steer the rounds.
        self._counted = looks + looks_difference(look, config.likeness, config.steering)
        self._shape = by_shape(look, config.likeness)
        self._sure = look.points / (look.points + config.steering.points)
        self._certain = config.alignment.at_once

    def run(self, hasty: bool) -> None:
        """All rounds; in haste, the first alone. Then the best are placed once more."""
        own = self._config.alignment
        sizes = own.tried[:1] if hasty else own.tried
        if not self._rounds_end(self._left, lambda count: sizes) and not hasty:
            shares = own.blindly if self._placed.blind else own.glanced
            self._rounds_end(
                self._at_a_glance(),
                lambda count: [max(math.ceil(share * count), own.least) for share in shares],
            )
        promise = self._counted + own.first * self._placed.agreed
        promise[self._placed.alignment <= own.lowest] = -np.inf
        last = np.argsort(-promise, kind="stable")[: own.last]
        self._placed.finish(np.sort(last[np.isfinite(promise[last])]))

    def _at_a_glance(self) -> Rows:
        """Those left, the most probable after a glance first."""
        left = np.sort(self._left)
        promise = self._counted[left] + self._config.alignment.first * self._placed.glances(left)
        return left[np.argsort(-promise, kind="stable")]

    def _rounds_end(self, ranked: Rows, sizes: Callable[[int], Sequence[int]]) -> bool:
        """Rounds of the first of the ranked ones, of those after them, and so on; whether they end
        before all of those are tried.

        sizes : of the rounds, in objects of those with colours, of which there are so many, and of
            those without
        """
        by_kind = []
        for plain in (False, True):
            ends = np.cumsum(np.array(sizes(int(np.sum(self._plain == plain))), np.int64))
            of_kind = ranked[self._plain[ranked] == plain]
            by_kind.append(np.split(of_kind, ends)[:-1])
        for rows in zip(*by_kind, strict=True):
            # In the prior's order, in which shards hold them.
            if self._round_ends(np.sort(np.concatenate(rows))):
                return True
            self._certain = self._config.alignment.certain
        return False

    def _round_ends(self, rows: Rows) -> bool:
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
        most = self._counted[self._left].max(initial=-np.inf) + self._config.steering.alignment
        return bool(self._agreed().max() > most)

    def _found(self) -> bool:
        """Whether the best is right for all that speaks against it, and stands out."""
        from scipy.special import softmax

        own, weight = self._config.alignment, self._config.steering.alignment
        total = self._agreed(self._sure)
        best = int(total.argmax())
        unlike = weight * (1 - self._placed.agreed[best]) - self._shape[best]
        return bool(unlike <= self._certain and softmax(total)[best] >= own.distinct)

    def _agreed(self, sure: float = 1.0) -> Nats:
        return self._counted + sure * self._config.steering.alignment * self._placed.agreed
