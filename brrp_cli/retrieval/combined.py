"""CLIP and appearance together."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.base import (
    Each,
    Retriever,
    hasty,
    helped,
    knows_depth,
    one_image,
    unknown,
)


class BothRetriever:
    """P(c|R) ~ product of two retrievers' probabilities.

    Of the first one only the ratios between objects count: CLIP's share for what is not in the
    prior was not fitted, so that the second one's is kept. Where no object is possible for both,
    the second one's answer stands.
    """

    name = "both"

    def __init__(self, first: Retriever, second: Retriever) -> None:
        self._first = first
        self._second = second

    @property
    def aligns(self) -> bool:
        """Whether one of the two knows the depth."""
        return knows_depth(self._first) or knows_depth(self._second)

    @contextmanager
    def one_image(self) -> Iterator[None]:
        """See retrieval/base.py."""
        with one_image(self._first), one_image(self._second):
            yield

    @contextmanager
    def hasty(self) -> Iterator[None]:
        """See retrieval/base.py."""
        with hasty(self._first), hasty(self._second):
            yield

    @contextmanager
    def helped(self, each: Each) -> Iterator[None]:
        """See retrieval/base.py."""
        with helped(self._first, each), helped(self._second, each):
            yield

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame; the sum is that of the second retriever."""
        second = self._second.probabilities(frame, object_id)
        product = self._first.probabilities(frame, object_id) * second
        if not product.sum() > 0:
            return second
        return np.asarray((1 - unknown(second)) * product / product.sum(), dtype=np.float64)
