"""What every retriever is: P(c|R), the probability of each stored object given the image.

The paper uses CLIP for it (section IV-B); anything that can score the prior's objects against what
is seen of one object can stand in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from heapq import nsmallest
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame

R = TypeVar("R")


class Each(Protocol):
    """do(common, *one) of each of `args`, in their order, wherever; `do` goes by its name."""

    def __call__(
        self, do: Callable[..., R], common: Any, args: Sequence[tuple[Any, ...]], /
    ) -> list[R]:
        """See above."""


def here(do: Callable[..., R], common: Any, args: Sequence[tuple[Any, ...]], /) -> list[R]:
    """`Each`, one after the other."""
    return [do(common, *one) for one in args]


class Retriever(Protocol):
    """Gives P(c|R) over the objects of one prior. `name` is written beside the results.

    One that lays stored objects over the measured depth says so with `aligns` = True: see
    `knows_depth`.
    """

    @property
    def name(self) -> str:
        """Short name, such as `clip`."""

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame, in the order of the prior's names.

        The sum is at most 1. What is missing from 1 is the probability that the prior does not hold
        the object (`unknown`); a retriever that cannot tell gives a sum of 1.
        """


def knows_depth(retriever: Retriever) -> bool:
    """Whether P(c|R) follows from how stored objects lie over the measured depth, too: that depth
    is not to count a second time in full."""
    return bool(getattr(retriever, "aligns", False))


@contextmanager
def one_image(retriever: Retriever | None) -> Iterator[None]:
    """While this lasts, all frames are one image with one mask or another. A retriever may give
    what it saw of a mask again, though what else is masked changes it a little: it has a method
    `one_image` then."""
    with getattr(retriever, "one_image", nullcontext)():
        yield


@contextmanager
def hasty(retriever: Retriever) -> Iterator[None]:
    """While this lasts, a retriever may look at fewer objects: most masks that are tried are no
    object. It has a method `hasty` then."""
    with getattr(retriever, "hasty", nullcontext)():
        yield


@contextmanager
def helped(retriever: Retriever, each: Each) -> Iterator[None]:
    """While this lasts, a retriever may let others do its steps. It has a method `helped` then."""
    with getattr(retriever, "helped", lambda _: nullcontext())(each):
        yield


def sendable(retriever: Retriever) -> bool:
    """Whether another process can ask a copy of it. It has `sendable` = True then."""
    return bool(getattr(retriever, "sendable", False))


def unknown(probabilities: NDArray[np.floating]) -> float:
    """P(not in the prior | R), in [0, 1], of P(c|R) (n,)."""
    # Sums of rounded numbers miss 1 by a little.
    missing = 1.0 - float(np.sum(probabilities, dtype=np.float64))
    return min(missing, 1.0) if missing > 1e-9 else 0.0


def top_k(
    probabilities: NDArray[np.floating], names: Sequence[str], k: int
) -> list[tuple[str, float]]:
    """The k most probable objects, most probable first, as (name, probability).

    Equal probabilities go in the order of names, so that the choice never hangs on the sorting
    routine. A k beyond the prior's size gives all of its objects. Only the best are sorted.
    """
    if len(probabilities) != len(names):
        raise ValueError(f"{len(probabilities)} probabilities for {len(names)} objects")
    values = np.asarray(probabilities, dtype=np.float64)
    k = min(k, len(values))
    if k < 1:
        return []
    least = float(np.partition(values, -k)[-k])
    above, ties = (np.flatnonzero(found).tolist() for found in (values > least, values == least))
    better = sorted(
        ((names[row], float(values[row])) for row in above), key=lambda t: (-t[1], t[0])
    )
    equal = nsmallest(k - len(better), (names[row] for row in ties))
    return sorted(better, key=lambda t: (-t[1], t[0])) + [(name, least) for name in equal]
