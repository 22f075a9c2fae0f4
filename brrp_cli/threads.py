"""The objects of a frame on several cores, with the bytes of one.

Libraries add in the order in which their threads end, so that their own threads change the last
bits of a result. Each object has one thread, and the libraries none of their own.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from brrp_cli.dependencies import thread_pools

TURN = 1e-4  # seconds

S = TypeVar("S")
T = TypeVar("T")


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0))


def in_threads(call: Callable[[S], T], items: Sequence[S], workers: int) -> Iterator[T]:
    """call(item) of each item, in their order, `workers` at a time; the first error ends it."""
    workers = min(workers, len(items))
    with _one_thread_each():
        if workers <= 1:
            yield from map(call, items)
            return
        with _short_turns(), ThreadPoolExecutor(workers, "object", initializer=_hold) as pool:
            futures = [pool.submit(call, item) for item in items]
            try:
                for future in futures:
                    yield future.result()
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    import torch

    before = torch.get_num_threads()
    with thread_pools().limit(limits=1):
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(before)


@contextmanager
def _short_turns() -> Iterator[None]:
    """Much of the work is small steps of NumPy, for which threads take turns in the interpreter:
    who waits five milliseconds for his, as is usual, computes nothing meanwhile."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(min(before, TURN))
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def one_thread_for_good() -> None:
    """As in the threads of `in_threads`, for a process that does nothing else."""
    _hold()
    thread_pools().limit(limits=1)


def _hold() -> None:
    """OpenMP's number of threads is each thread's own."""
    import torch

    torch.set_num_threads(1)
    thread_pools().limit(limits=1, user_api="openmp")
