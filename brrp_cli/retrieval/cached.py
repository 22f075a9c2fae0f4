"""A retriever that asks another one only once for each object of a frame."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.base import Retriever, knows_depth


class RememberingRetriever:
    """P(c|R) of `retriever` for the objects of one frame, kept.

    Attributes
    ----------
    answers : object id -> P(c|R) (n,), for the objects that were asked for
    seconds : object id -> how long the first answer took
    """

    def __init__(self, retriever: Retriever) -> None:
        self._retriever = retriever
        self.answers: dict[int, NDArray[np.float64]] = {}
        self.seconds: dict[int, float] = {}

    @property
    def name(self) -> str:
        """The asked retriever's name."""
        return self._retriever.name

    @property
    def aligns(self) -> bool:
        """Whether the asked retriever knows the depth."""
        return knows_depth(self._retriever)

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object; `frame` must be the same each time."""
        if object_id not in self.answers:
            start = time.perf_counter()
            self.answers[object_id] = self._retriever.probabilities(frame, object_id)
            self.seconds[object_id] = time.perf_counter() - start
        return self.answers[object_id]
