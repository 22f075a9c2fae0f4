"""Retrieval that is given, not found: what an ablation holds against a real retriever."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame

# P(c|R) of the true object; what is left is spread over the others.
TRUTH_PROBABILITY = 0.7


class UniformRetriever:
    """P(c|R) = 1/n: the prior without retrieval. Ties are taken in the order of names."""

    name = "uniform"

    def __init__(self, names: Sequence[str]) -> None:
        self._count = len(names)

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,), all equal."""
        return np.full(self._count, 1 / self._count)


class TruthRetriever:
    """P(c|R) = 0.7 for the true object, the rest spread evenly over the others.

    names : the prior's; truth : mask id -> name of the object that it is.
    """

    name = "truth"

    def __init__(self, names: Sequence[str], truth: Mapping[int, str]) -> None:
        self._names = list(names)
        self._truth = truth

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,). Errors: RetrievalError if the true object is not in the prior."""
        name = self._truth[object_id]
        if name not in self._names:
            raise RetrievalError(
                "The true object is not in the prior",
                where=f"{frame.source}, object {object_id}",
                expected="an object of the prior",
                found=name,
                fix="use another retriever for objects that the prior does not hold",
            )
        if len(self._names) == 1:
            return np.ones(1)
        rest = (1 - TRUTH_PROBABILITY) / (len(self._names) - 1)
        probabilities = np.full(len(self._names), rest)
        probabilities[self._names.index(name)] = TRUTH_PROBABILITY
        return probabilities
