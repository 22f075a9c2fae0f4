"""A retriever whose every answer is looked at before it is used."""

from __future__ import annotations

import time
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.base import Retriever, knows_depth

# Sums of many rounded numbers miss 1 by a little.
ROUNDING = 1e-3


class CheckedRetriever:
    """P(c|R) of `retriever` over `count` objects. Errors: RetrievalError for what is no such
    thing.

    seconds : that its answers took so far, without what callers waited for one another
    """

    def __init__(self, retriever: Retriever, count: int) -> None:
        self._retriever = retriever
        self._count = count
        self.seconds = 0.0
        # Retrievers answer for all objects of a frame at the first question about one.
        self._asked = Lock()

    def __reduce__(self) -> tuple[type[CheckedRetriever], tuple[Retriever, int]]:
        return CheckedRetriever, (self._retriever, self._count)

    @property
    def name(self) -> str:
        """The asked retriever's name."""
        return self._retriever.name

    @property
    def aligns(self) -> bool:
        """Whether the asked retriever knows the depth."""
        return knows_depth(self._retriever)

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object."""
        with self._asked:
            start = time.perf_counter()
            answer = np.asarray(self._retriever.probabilities(frame, object_id), dtype=np.float64)
            self.seconds += time.perf_counter() - start
        good = answer.shape == (self._count,) and bool((answer >= 0).all())
        if not good or not answer.sum() <= 1 + ROUNDING:
            raise RetrievalError(
                f"Retrieval by {self.name} gave no probabilities",
                where=f"object {object_id}",
                expected=f"{self._count} numbers from 0 to 1, with a sum of at most 1",
                found=f"shape {answer.shape}, sum {answer.sum():g}",
            )
        return answer
