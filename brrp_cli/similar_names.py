"""The name that somebody meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: str, names: Iterable[str]) -> str | None:
    """The one of `names` that is most like `name`; None where none is like it."""
    found = get_close_matches(name.lower(), {each.lower(): each for each in names}, n=1)
    return next((each for each in names if found and each.lower() == found[0]), None)
