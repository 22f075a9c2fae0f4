"""--json: one JSON object on stdout, and what is told to people on stderr."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import click

json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print the report as JSON, all else on stderr."
)


@contextmanager
def report_of(as_json: bool) -> Iterator[dict[str, Any]]:
    """Yield a table to fill, which is printed at the end; with --json, and then alone on stdout."""
    table: dict[str, Any] = {}
    if not as_json:
        yield table
        return
    with redirect_stdout(sys.stderr):
        yield table
    click.echo(json.dumps(_plain(table), indent=1, allow_nan=False))


def _plain(value: Any) -> Any:
    """The same without NaN and inf, which JSON does not know."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
