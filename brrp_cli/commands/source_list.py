"""--list: what a source holds."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from brrp_cli.spoken import counted

if TYPE_CHECKING:
    from brrp_cli.commands.source_options import SourceOptions

# Names that are shown of many frames: the first and the last ones.
SHOWN = 20


def print_list(source: SourceOptions, *, as_json: bool) -> None:
    """Print format, frames and what else is in SOURCE. UsageError without one; FrameError."""
    from brrp_cli.frames.readers import format_of

    if source.path is None:
        raise click.UsageError("--list tells what a SOURCE holds: name one")
    names = source.names()
    found = format_of(source.path)
    contents = [] if found.contents is None else found.contents(source.path, source.request)
    if as_json:
        table: dict[str, Any] = {"source": str(source.path), "format": found.title}
        click.echo(json.dumps({**table, "frames": names, "contents": contents}, indent=1))
        return
    click.echo(f"{source.path}: {found.title}, {counted(len(names), 'frame')}")
    for line in contents:
        click.echo(f"  {line}")
    numbered = [f"  {number:>5}  {name}" for number, name in enumerate(names)]
    left = len(numbered) - 2 * SHOWN
    if left > 0:
        numbered[SHOWN:-SHOWN] = [f"    ...  {left} more"]
    for line in numbered:
        click.echo(line)
    if len(names) > 1:
        click.echo(
            "Choose one with --index N or NAME; brrp reconstruct takes many with --frames A:B"
        )
