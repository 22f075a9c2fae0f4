"""Depth of one camera as another camera beside it sees it: registration to the colour image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import Array


def align_depth(
    depth: Array, K: Array, offset: float, K_target: Array, shape: tuple[int, int]
) -> NDArray[np.float64]:
    """Depth (H, W), metres, 0 = none, in the image of a camera with `K_target` and `shape`.

    offset : metres by which the depth camera stands to the right of the target camera; both look
    the same way, so that z stays what it is.

    As in librealsense's align: each pixel is carried over as the rectangle that its corners span,
    and the nearest wins. What the depth camera did not see stays empty.
    """
    rows, columns = np.nonzero(depth > 0)
    z = depth[rows, columns].astype(np.float64)
    shift = K_target[0, 0] * offset / z
    zoom_x, zoom_y = K_target[0, 0] / K[0, 0], K_target[1, 1] / K[1, 1]
    left = (columns - 0.5 - K[0, 2]) * zoom_x + K_target[0, 2] + shift
    top = (rows - 0.5 - K[1, 2]) * zoom_y + K_target[1, 2]
    # A pixel of the target belongs to the rectangle that holds its centre; a thin rectangle that
    # holds none leaves no trace, and one wider than a pixel leaves no crack.
    u0, v0 = np.ceil(left).astype(np.int64), np.ceil(top).astype(np.int64)
    u1 = np.ceil(left + zoom_x + _SLACK).astype(np.int64)
    v1 = np.ceil(top + zoom_y).astype(np.int64)
    far_first = np.argsort(-z, kind="stable")
    target = np.zeros(shape)
    best = np.full(shape, np.inf)
    for dv in range(int((v1 - v0).max(initial=0))):
        for du in range(int((u1 - u0).max(initial=0))):
            u, v = u0 + du, v0 + dv
            inside = (u < u1) & (v < v1) & (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
            chosen = far_first[inside[far_first]]
            layer = np.full(shape, np.inf)
            layer[v[chosen], u[chosen]] = z[chosen]
            best = np.minimum(best, layer)
    known = np.isfinite(best)
    target[known] = best[known]
    return target


# Pixels: neighbours at slightly different depth are carried apart by less than this.
_SLACK = 0.3
