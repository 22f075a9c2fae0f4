"""Progress bars and notes on stderr, silent with -q."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

T = TypeVar("T")

_BAR: ContextVar[Any] = ContextVar("bar", default=None)  # of `only_bar`, where it is drawn
_ALONE: ContextVar[bool] = ContextVar("alone", default=False)
_HUSHED: ContextVar[bool] = ContextVar("hushed", default=False)


def quiet() -> bool:
    """Whether `brrp -q` asked for errors only."""
    return logging.getLogger().getEffectiveLevel() >= logging.ERROR


def note(text: str) -> None:
    """Print what is of interest while a command works; its results go to stdout."""
    import click

    if not quiet() and not _HUSHED.get():
        click.echo(text, err=True)


def say(text: str) -> None:
    """Print a result to stdout, clear of the bar that stands on the terminal."""
    import click

    bar = _BAR.get()
    if bar is None:
        click.echo(text)
    else:
        bar.write(click.unstyle(text) if not sys.stdout.isatty() else text, file=sys.stdout)


def progress(items: Iterable[T], label: str, total: int | None = None) -> Iterable[T]:
    """The same items, counted by a bar on stderr if that is a terminal."""
    # Without a bar no tqdm either: it makes a lock between processes even when it is disabled.
    if quiet() or _ALONE.get() or not sys.stderr.isatty():
        return items
    from tqdm import tqdm

    if total is None and isinstance(items, Sized):
        total = len(items)
    bar: Iterable[T] = tqdm(items, desc=label, total=total, file=sys.stderr)
    return bar


@contextmanager
def only_bar(total: int, label: str) -> Iterator[Callable[[], None]]:
    """One bar on stderr, if that is a terminal, and none of `progress` beside it; yields what
    moves it on."""
    drawn = not quiet() and sys.stderr.isatty()
    alone = _ALONE.set(True)
    try:
        if not drawn:
            yield lambda: None
            return
        from tqdm import tqdm

        with tqdm(total=total, desc=label, file=sys.stderr) as bar:
            token = _BAR.set(bar)
            try:
                yield lambda: bar.update() and None
            finally:
                _BAR.reset(token)
    finally:
        _ALONE.reset(alone)


@contextmanager
def hushed(below: int = logging.WARNING) -> Iterator[None]:
    """Without notes, and without what the log tells below that level, unless that is --verbose."""
    token = _HUSHED.set(True)
    log = logging.getLogger("brrp_cli")
    before = log.level
    if logging.INFO <= log.getEffectiveLevel() < below:
        log.setLevel(below)
    try:
        yield
    finally:
        log.setLevel(before)
        _HUSHED.reset(token)


@contextmanager
def byte_bar(total: int, label: str) -> Iterator[Callable[[int], None]]:
    """A bar on stderr, if that is a terminal, for `total` bytes; yields what moves it on."""
    from tqdm import tqdm

    disable = quiet() or not sys.stderr.isatty()
    with tqdm(
        total=total,
        desc=label,
        unit="B",
        unit_scale=True,
        unit_divisor=1000,
        file=sys.stderr,
        disable=disable,
    ) as bar:
        yield lambda count: bar.update(count) and None
