"""How a message names an option, as the user typed it or would have, how it counts and lists, and
what it calls an object that is none of the prior's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

NOT_STORED = "none of them"

_TYPED: ContextVar[bool] = ContextVar("typed", default=False)


@contextmanager
def command_line() -> Iterator[None]:
    """Within it options are named as on the command line; else as Python's arguments."""
    token = _TYPED.set(True)
    try:
        yield
    finally:
        _TYPED.reset(token)


def option(name: str, value: object = None) -> str:
    """`--depth-scale 0.001` on the command line, `depth_scale=0.001` in Python; without a value
    `--depth-scale` and `depth_scale`."""
    if _TYPED.get():
        typed = "--" + name.replace("_", "-")
        return typed if value is None else f"{typed} {value}"
    return name if value is None else f"{name}={value}"


def either(command: str, python: str) -> str:
    """Advice in the words of the command line where it was used, else in Python's."""
    return command if _TYPED.get() else python


def few(names: Sequence[str]) -> str:
    """The first of them, and how many more there are: `a, b, c, d, e and 2 more`."""
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return ", ".join(names[:5]) + more


def counted(number: int, noun: str, nouns: str | None = None) -> str:
    """`1 object`, `2 objects`; with the plural where it is no mere s, `2 meshes`."""
    return f"{number} {agreed(number, noun, nouns or f'{noun}s')}"


def kind_of(value: object) -> str:
    """What a value of a JSON file is."""
    for kind, said in _KINDS:
        if isinstance(value, kind):
            return said
    return "nothing"


_KINDS = (
    (bool, "true or false"),
    ((int, float), "a number"),
    (str, "text"),
    (list, "a list"),
    (dict, "keys with values"),
)


def agreed(number: int, one: str, many: str) -> str:
    """The word that goes with that number: `was` of one, `were` of several."""
    return one if number == 1 else many
