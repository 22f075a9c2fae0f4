"""What objects and files of a prior may be called."""

from __future__ import annotations

import re

APPEARANCE_NAME = re.compile(r"appearance-[0-9a-f]{16}\.npy")
SHARD_NAME = re.compile(r"shards/shard-[0-9a-f]{16}\.h5")


def safe_name(text: str) -> str:
    """`text` as a name that is safe in file systems and in HDF5."""
    return re.sub(r"[^\w.-]+", "_", text).strip("._") or "object"
