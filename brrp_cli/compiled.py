"""Inner loops as machine code.

NumPy goes over an array once for every operation; a placement of twenty points is so small that
most of the time goes into the calls. Numba makes one loop of them, which leaves the interpreter to
other threads. It compiles a function when it is first called, and keeps the result beside the
source, or in the user's cache folder.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit

# Sums may be taken in any order, and a division by 0 is no error: only then are several turns of a
# loop done at a time.
FREELY: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "contract", "nsz"}}

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """`function` of numbers and arrays, compiled. What it calls is in its own file: a change
    elsewhere would not be seen, and the kept code used on."""
    return cast(F, _kept(function, {}))


def compiled_freely(function: F) -> F:
    """The same, faster: sums are taken in an order that the machine code decides. Arrays of another
    layout would be another code, and other bytes, so all are C-contiguous when they arrive. To be
    called from Python; compiled functions call `inlined` ones."""
    made = _kept(function, FREELY)

    @wraps(function)
    def called(*arguments: Any) -> Any:
        return made(*(_in_order(each) for each in arguments))

    return cast(F, called)


def inlined(function: F) -> F:
    """`function`, compiled into those of its file that call it, also where it is long: a loop with
    a call in it does one point after the other."""
    return cast(F, njit(nogil=True, forceinline=True, **FREELY)(function))


def _kept(function: Callable[..., object], how: dict[str, Any]) -> Callable[..., Any]:
    try:
        return cast(Callable[..., Any], njit(cache=True, nogil=True, **how)(function))
    except RuntimeError:  # there is no folder to keep it in
        return cast(Callable[..., Any], njit(nogil=True, **how)(function))


def _in_order(argument: Any) -> Any:
    if not isinstance(argument, np.ndarray):
        return argument
    flags = argument.flags
    return argument if flags.c_contiguous and flags.aligned else np.array(argument, order="C")
