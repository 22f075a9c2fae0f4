"""Progress bars and notes on stderr, silent with -q."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


def quiet() -> bool:
    """Whether `brrp -q` asked for errors only."""
    return logging.getLogger().getEffectiveLevel() >= logging.ERROR


def note(text: str) -> None:
    """Print what is of interest while a command works; its results go to stdout."""
    import click

    if not quiet():
        click.echo(text, err=True)


def progress(items: Iterable[T], label: str, total: int | None = None) -> Iterable[T]:
    """The same items, counted by a bar on stderr if that is a terminal."""
    # Without a bar no tqdm either: it makes a lock between processes even when it is disabled.
    if quiet() or not sys.stderr.isatty():
        return items
    from tqdm import tqdm

    if total is None and isinstance(items, Sized):
        total = len(items)
    bar: Iterable[T] = tqdm(items, desc=label, total=total, file=sys.stderr)
    return bar


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
