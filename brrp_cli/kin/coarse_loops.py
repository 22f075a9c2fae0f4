"""Distances of points from stretched shapes, looked up in their coarse fields, as machine code. See
`compiled`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled_freely

Floats = NDArray[np.float32]

# All numbers of half precision, by their bits: machine code does not convert them.
HALVES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)
# Under the root of a slope's square.
LEAST_STEEPNESS = np.float32(1e-6)
ZERO, ONE = np.float32(0), np.float32(1)


@compiled_freely
def coarse_distances(
    stance: NDArray[np.int64],
    turn: Floats,
    middle: Floats,
    half: Floats,
    taper: Floats,
    ratio: Floats,
    points: Floats,
    coarse: NDArray[np.uint16],
    halves: Floats,
    nodes: int,
    reach: float,
) -> Floats:
    """See `coarse_distance`: (B, n) metres.

    stance (B,), turn (B,), middle (B, 3), half (B, 3), taper (B,) : of `Placements`; ratio : (B, 3)
    squares of the stored sides over `half`; points : (n, 3); coarse : (E, nodes**3, 4) of
    `Library`, as bits; halves : `HALVES`
    """
    found = np.empty((len(stance), len(points)), np.float32)
    step, most = np.float32((nodes - 1) / (2 * reach)), np.float32(nodes - 1)
    wide = np.float32(reach)
    for b in range(len(stance)):
        c, s = np.float32(math.cos(turn[b])), np.float32(math.sin(turn[b]))
        field = coarse[stance[b]]
        a0, a1, a2 = ONE / half[b, 0], ONE / half[b, 1], ONE / half[b, 2]
        for n in range(len(points)):
            x, y = points[n, 0] - middle[b, 0], points[n, 1] - middle[b, 1]
            w = (points[n, 2] - middle[b, 2]) * a2
            narrow = ONE / (ONE + taper[b] * min(max(w, -ONE), ONE))
            u = (c * x + s * y) * narrow * a0
            v = (c * y - s * x) * narrow * a1
            i = np.int64(np.rint(min(max((u + wide) * step, ZERO), most)))
            j = np.int64(np.rint(min(max((v + wide) * step, ZERO), most)))
            k = np.int64(np.rint(min(max((w + wide) * step, ZERO), most)))
            node = field[(i * nodes + j) * nodes + k]
            steepness = (
                halves[node[1]] * ratio[b, 0]
                + halves[node[2]] * ratio[b, 1]
                + halves[node[3]] * ratio[b, 2]
            )
            distance = halves[node[0]] / np.sqrt(max(steepness, LEAST_STEEPNESS))
            # Off the grid, the way to it on top.
            over_u = max(abs(u) - wide, ZERO) * half[b, 0]
            over_v = max(abs(v) - wide, ZERO) * half[b, 1]
            over_w = max(abs(w) - wide, ZERO) * half[b, 2]
            found[b, n] = distance + np.sqrt(over_u * over_u + over_v * over_v + over_w * over_w)
    return found
