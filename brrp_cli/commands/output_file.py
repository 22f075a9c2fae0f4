"""A file that -o names."""

from __future__ import annotations

from pathlib import Path

import click


def require_suffix(path: Path, suffix: str) -> None:
    """UsageError for a name of another kind of file than the command writes."""
    if path.suffix != suffix:
        raise click.UsageError(f"-o must end in {suffix}, not {path.name!r}")
