"""What depth shows to be free of a model, of many placements, as machine code. See `compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled_freely

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)


@compiled_freely
def contradicted(
    T_cam_model: Array,
    surface: Array,
    depth: Floats,
    K: Array,
    normal: Array,
    offset: float,
    tolerance: float,
    slope: float,
) -> Array:
    """See `Verifier.score`: of placements (B, 4, 4), the shares (B,) of surface points (m, 3) in
    space that `depth` (H, W) shows to be free, and below the plane, together."""
    found = np.empty(len(T_cam_model))
    points = np.ascontiguousarray(surface.T).astype(np.float32)
    image, flat = K.astype(np.float32), depth.ravel()
    up = normal.astype(np.float32)
    above = np.float32(offset + tolerance)
    near, steep = np.float32(tolerance), np.float32(1 / slope)
    width = np.float32(depth.shape[1])
    right, bottom = width - ONE, np.float32(depth.shape[0] - 1)
    for b in range(len(T_cam_model)):
        T = T_cam_model[b].astype(np.float32)
        total = 0.0
        for m in range(len(surface)):
            p, q, r = points[0, m], points[1, m], points[2, m]
            x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
            y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
            z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3]
            below = -(up[0] * x + up[1] * y + up[2] * z + above)
            away = ONE / (z if z > ZERO else ONE)
            u = np.floor(x * away * image[0, 0] + image[0, 2] + HALF)
            v = np.floor(y * away * image[1, 1] + image[1, 2] + HALF)
            shown = (z > ZERO) & (u >= ZERO) & (u <= right) & (v >= ZERO) & (v <= bottom)
            pixel = np.int32(np.float64(v) * width + u) if shown else np.int32(0)
            gap = flat[np.uintp(np.uint32(pixel))] - z - near
            # Where no depth is, nothing speaks against it.
            gap = gap if shown and gap > ZERO else ZERO
            total += min(max(below * steep, ZERO), ONE) + min(gap * steep, ONE)
        found[b] = total / len(surface)
    return found
