"""Hollow creases of a surface, as machine code. See `compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Floats = NDArray[np.float32]


@compiled
def hollow_cosines(points: Floats, normals: Floats, ways: NDArray[np.int64], near: float) -> Floats:
    """(H, W) least cosine between the normals on both sides of a pixel, where these face each
    other; 1 where none do.

    points : (H, W, 3) metres; normals : (H, W, 3) unit; NaN = none
    ways : (k, 2) rows and columns from the pixel to one side, and back to the other
    near : metres between the two, or they show two surfaces
    """
    height, width = points.shape[:2]
    found = np.ones((height, width), np.float32)
    most = np.float32(near * near)
    for way in range(len(ways)):
        down, right = ways[way]
        for i in range(abs(down), height - abs(down)):
            for j in range(abs(right), width - abs(right)):
                first, second = points[i + down, j + right], points[i - down, j - right]
                one, other = normals[i + down, j + right], normals[i - down, j - right]
                x, y, z = first[0] - second[0], first[1] - second[1], first[2] - second[2]
                # What compares NaN is false.
                if not x * x + y * y + z * z < most:
                    continue
                bend = (one[0] - other[0]) * x + (one[1] - other[1]) * y
                if not bend + (one[2] - other[2]) * z < 0:
                    continue
                cosine = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
                if cosine < found[i, j]:
                    found[i, j] = cosine
    return found
