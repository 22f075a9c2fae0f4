"""Which objects share a shard, and what that shard is called."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

MEAN_OBJECTS = 8
MAX_OBJECTS = 16


def plan_shards(names: Sequence[str]) -> list[list[str]]:
    """Cut the sorted names into runs of about 8, at most 16.

    The cuts depend on the names beside them alone (content-defined chunking), so that a mesh that
    is added or removed changes one shard and leaves the others as they are.
    """
    groups: list[list[str]] = [[]]
    for name in sorted(names):
        if len(groups[-1]) == MAX_OBJECTS:
            groups.append([])
        groups[-1].append(name)
        if hashlib.sha256(name.encode()).digest()[0] % MEAN_OBJECTS == 0:
            groups.append([])
    return [group for group in groups if group]


def shard_file(parameters: dict[str, Any], members: Sequence[tuple[str, str]]) -> str:
    """The shard's file, relative to the prior, from all that decides its content: the parameters
    and (name, input_sha256) of its members."""
    key = json.dumps([parameters, [list(member) for member in members]], sort_keys=True)
    return f"shards/shard-{hashlib.sha256(key.encode()).hexdigest()[:16]}.h5"
