"""What is asked twice of one frame is computed once."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Concatenate, Generic, ParamSpec, TypeVar

from brrp_cli.frames.frame import Frame

P = ParamSpec("P")
R = TypeVar("R")


def kept_for_last_frame(
    function: Callable[Concatenate[Frame, P], R],
) -> Callable[Concatenate[Frame, P], R]:
    """`function`, a pure one, with its answer for the last frame that it was asked about.

    Its other arguments, by position, have to be the same objects, or equal numbers. The frame is
    not kept alive, nor is the answer once the frame is gone.
    """
    return _kept(function, lambda frame: (frame,))


def kept_for_last_image(
    function: Callable[Concatenate[Frame, P], R],
) -> Callable[Concatenate[Frame, P], R]:
    """The same for a function that does not look at the masks: frames that share their arrays
    (`Frame.with_masks`) are one to it."""
    return _kept(function, lambda frame: (frame.rgb, frame.points, frame.K))


@dataclass(frozen=True)
class _Answer(Generic[R]):
    """of : what it depends on, besides the arguments, not kept alive"""

    of: tuple[weakref.ref[object], ...]
    args: tuple[object, ...]
    value: R

    def answers(self, of: tuple[object, ...], args: tuple[object, ...]) -> bool:
        """Whether it is the one to this question."""
        return _same(tuple(each() for each in self.of), of) and _same(self.args, args)


def _kept(
    function: Callable[Concatenate[Frame, P], R],
    parts: Callable[[Frame], tuple[object, ...]],
) -> Callable[Concatenate[Frame, P], R]:
    """`function` with its last answer, for a frame with the same `parts`."""
    last: _Answer[R] | None = None

    @wraps(function)
    def asked(frame: Frame, *args: P.args, **kwargs: P.kwargs) -> R:
        nonlocal last
        if kwargs:
            return function(frame, *args, **kwargs)
        known, of = last, parts(frame)
        if known is not None and known.answers(of, args):
            return known.value
        answer = function(frame, *args, **kwargs)

        def forget(part: object) -> None:
            nonlocal last
            if last is not None and any(each is part for each in last.of):
                last = None

        last = _Answer(tuple(weakref.ref(each, forget) for each in of), args, answer)
        return answer

    return asked


def _same(a: tuple[object, ...], b: tuple[object, ...]) -> bool:
    return len(a) == len(b) and all(
        x is y or (isinstance(x, int) and x == y) for x, y in zip(a, b, strict=True)
    )
