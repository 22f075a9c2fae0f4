"""What every tool does with an error of brrp."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from brrp_cli.errors import BrrpError
from brrp_cli.spoken import command_line


@contextmanager
def one_message() -> Iterator[None]:
    """Around a tool's `main`: an error ends it with its message, which names options as typed,
    and no traceback."""
    try:
        with command_line():
            yield
    except BrrpError as error:
        sys.exit(f"Error: {error}")
