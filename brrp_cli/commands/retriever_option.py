"""The value of --retriever: a name, or a file with probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click


class RetrieverName(click.ParamType):
    """One of `names`, or the path of a file that is there."""

    name = "NAME|FILE"

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name or the path as it was given."""
        if value not in self.names and not Path(value).is_file():
            expected = ", ".join(self.names)
            self.fail(f"{value!r} is neither a file nor one of {expected}", param, ctx)
        return str(value)
