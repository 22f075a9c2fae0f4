"""One seed for everything: named children of the user's seed.

A child depends on the seed and on names alone, never on the order of calls or on how many workers
run, so that the same seed gives the same bytes.
"""

from __future__ import annotations

import hashlib

import numpy as np


def child_seed(seed: int, *names: str | int) -> int:
    """Seed in [0, 2**31) for the thing that `names` name (what Open3D and torch accept)."""
    text = "/".join([str(seed), *map(str, names)])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little") >> 1


def child_rng(seed: int, *names: str | int) -> np.random.Generator:
    """NumPy generator seeded by `child_seed`."""
    return np.random.default_rng(child_seed(seed, *names))
