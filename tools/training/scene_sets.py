"""Folders of scenes that a training takes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from brrp_cli.errors import BrrpError


def check_names(folders: Iterable[Path]) -> None:
    """BrrpError where two folders have one name, by which their examples are kept."""
    counts = Counter(folder.resolve().name for folder in folders)
    twice = [name for name, count in counts.items() if count > 1]
    if twice:
        raise BrrpError(
            "Two folders of scenes have one name", found=", ".join(twice), fix="rename one"
        )
