"""A folder of results that a user named."""

from __future__ import annotations

from pathlib import Path

from brrp_cli.errors import ResultError
from brrp_cli.files import exists


def require_results(folder: Path) -> None:
    """ResultError where there is nothing, told before what takes long to import."""
    if not exists(folder):
        raise ResultError(
            "There are no results that can be read",
            where=folder,
            found="no such folder",
            fix="give the folder that `brrp reconstruct` named in its last line",
        )
