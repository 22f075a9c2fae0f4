"""The name that somebody meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def most_similar_name(name: str, names: Iterable[str]) -> str | None:
    """The one of `names` that is most like `name`, small or capital letters; None where none is
    like it."""
    # Of names that differ in case alone, the first.
    by_lower: dict[str, str] = {}
    for each in names:
        by_lower.setdefault(each.lower(), each)
    found = get_close_matches(name.lower(), by_lower, n=1)
    return by_lower[found[0]] if found else None
