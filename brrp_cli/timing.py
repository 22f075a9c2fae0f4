"""Seconds of each stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Put the wall time of the block into `seconds` under the stage's name."""
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start
