"""Transforms of many placements at once, as machine code. See `compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]


@compiled
def inverses(T: Array) -> Array:
    """Inverses (B, 4, 4) of similarities (B, 4, 4), in less than a tenth of the time that
    LAPACK takes for matrices of any kind."""
    found = np.zeros(T.shape)
    for b in range(len(T)):
        square = T[b, 0, 0] ** 2 + T[b, 1, 0] ** 2 + T[b, 2, 0] ** 2
        for i in range(3):
            for j in range(3):
                found[b, i, j] = T[b, j, i] / square
        for i in range(3):
            for j in range(3):
                found[b, i, 3] -= found[b, i, j] * T[b, j, 3]
        found[b, 3, 3] = 1.0
    return found
