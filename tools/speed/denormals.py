"""Denormal numbers: how many arise where.

A float under its smallest normal number (1.2e-38 in single precision) is denormal. Some processors
multiply such numbers 15 to 20 times more slowly, others at full speed, so that a clock shows them
on the former alone. A count shows them on all.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils._python_dispatch import TorchDispatchMode

import brrp_cli

PACKAGE = str(Path(brrp_cli.__file__).parent)
# Unsigned integers of a float's size, and its bits without the sign.
_BITS = {
    np.dtype(np.float32): (np.uint32, np.uint32(0x7FFFFFFF)),
    np.dtype(np.float64): (np.uint64, np.uint64(0x7FFFFFFFFFFFFFFF)),
}


def count_denormals(values: NDArray[Any] | torch.Tensor) -> int:
    """How many of an array's numbers are denormal; 0 for any type but float32 and float64, and for
    a tensor that has no numbers yet (device "meta").

    Read from the bits: a thread that flushes denormals takes them for 0 when it compares.
    """
    if isinstance(values, torch.Tensor) and values.is_meta:
        return 0
    array = values.detach().cpu().numpy() if isinstance(values, torch.Tensor) else values
    if array.dtype not in _BITS:
        return 0
    kind, unsigned = _BITS[array.dtype]
    bits = np.ascontiguousarray(array).view(kind) & unsigned
    smallest = np.asarray(np.finfo(array.dtype).smallest_normal).view(kind)
    # 0 wraps around to the largest number.
    return int(np.count_nonzero(bits - kind(1) < smallest - kind(1)))


@contextmanager
def watch_denormals() -> Iterator[Counter[str]]:
    """Counts denormal numbers while it holds, by "folder.module.function" of brrp_cli.

    Seen are the results of all operations of torch and, as each function of brrp_cli returns, the
    arrays among its local variables and its result, but for its arguments; in the calling thread.
    What NumPy makes and drops within one expression is not seen. Functions without any are left
    out. Several times slower than without.
    """
    found: Counter[str] = Counter()

    def at_return(frame: FrameType, event: str, result: Any) -> None:
        code = frame.f_code
        if event != "return" or not code.co_filename.startswith(PACKAGE):
            return
        arguments = set(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
        made = [value for name, value in frame.f_locals.items() if name not in arguments]
        # One array may have several names.
        arrays = {id(a): a for a in _arrays([*made, result], depth=2)}
        _add(found, code, sum(map(count_denormals, arrays.values())))

    class Watch(TorchDispatchMode):
        def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None):
            result = func(*args, **(kwargs or {}))
            count = sum(map(count_denormals, _arrays(result, depth=2)))
            if count:
                _add(found, _caller(), count)
            return result

    before = sys.getprofile()
    with Watch():
        sys.setprofile(at_return)
        try:
            yield found
        finally:
            sys.setprofile(before)


def by_folder(found: Counter[str]) -> dict[str, int]:
    """Sums over each folder of brrp_cli, of which each holds a stage; the greatest first."""
    sums: Counter[str] = Counter()
    for name, count in found.items():
        sums[name.split(".")[0]] += count
    return dict(sums.most_common())


def _arrays(value: Any, depth: int) -> Iterator[NDArray[Any] | torch.Tensor]:
    """Arrays in a value, and in lists and tuples of it `depth` deep."""
    if isinstance(value, (np.ndarray, torch.Tensor)):
        yield value
    elif isinstance(value, (list, tuple)) and depth:
        for each in value:
            yield from _arrays(each, depth - 1)


def _caller() -> CodeType | None:
    """The innermost function of brrp_cli that is running."""
    frame: FrameType | None = sys._getframe()
    while frame is not None and not frame.f_code.co_filename.startswith(PACKAGE):
        frame = frame.f_back
    return None if frame is None else frame.f_code


def _add(found: Counter[str], code: CodeType | None, count: int) -> None:
    if not count:
        return
    if code is None:
        found["elsewhere"] += count
        return
    parts = Path(code.co_filename).relative_to(PACKAGE).with_suffix("").parts
    found[".".join([*parts, code.co_qualname])] += count
