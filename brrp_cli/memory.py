"""Memory of this process."""

from __future__ import annotations

import ctypes

# Of glibc's <malloc.h>.
_M_ARENA_MAX = -8


def one_heap() -> None:
    """Let all threads share one heap, before the first one is started.

    glibc gives each thread a heap of its own, and what was freed in one is of no use to another: a
    frame of ten objects takes a fifth more memory. Where there is no glibc nothing changes.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_ARENA_MAX, 1)
