"""What objects and files of a prior may be called, and what is told of a name that it has not."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from brrp_cli.errors import PriorError
from brrp_cli.similar_names import most_similar_name

APPEARANCE_NAME = re.compile(r"appearance-[0-9a-f]{16}\.npy")
SHARD_NAME = re.compile(r"shards/shard-[0-9a-f]{16}\.h5")


def safe_name(text: str) -> str:
    """`text` as a name that is safe in file systems and in HDF5."""
    return re.sub(r"[^\w.-]+", "_", text).strip("._") or "object"


def unknown_object(name: str, known: Iterable[str], prior: Path) -> PriorError:
    """What is told where somebody names an object that the prior does not have."""
    meant = most_similar_name(name, known)
    return PriorError(
        "The prior has no such object",
        where=prior,
        found=name,
        fix=f"did you mean {meant}?" if meant else "brrp prior list shows the names",
    )
