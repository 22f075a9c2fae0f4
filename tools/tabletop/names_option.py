"""Options that name meshes."""

from __future__ import annotations

import click


def prefixes(_context: click.Context, _option: click.Parameter, value: str) -> tuple[str, ...]:
    """The names, or beginnings of names, of an option that lists them."""
    return tuple(part.strip() for part in value.split(",") if part.strip())
