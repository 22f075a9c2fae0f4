"""A training that is told to stop ends the step that it is at."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event


@contextmanager
def signalled() -> Iterator[Event]:
    """An event that Ctrl-C or SIGTERM sets, so that the step at work is ended and kept; a second
    Ctrl-C does not wait for it."""
    stop = Event()

    def note(number: int, frame: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
