"""The part of a table that lies beyond the image: what the border cuts stands there, too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import TableConfig
from brrp_cli.hulls import convex_hull


def beyond_image(
    plan: NDArray[np.float64], flat: NDArray[np.bool_], config: TableConfig
) -> NDArray[np.float64] | None:
    """Half planes (m, 3) of the convex hull of a table's pixels at the image's border and of what
    lies `config.beyond` metres farther out; None where the table does not reach the border.

    plan : (H, W, 2) metres, NaN = no depth; flat : (H, W) the table's pixels
    """
    known = np.isfinite(plan[..., 0])
    corners = []
    for turns in range(4):
        at, on, seen = (np.rot90(each, turns) for each in (plan, flat, known))
        # A stereo camera sees nothing along one side of its image.
        first = np.argmax(seen, axis=1)
        rows = np.flatnonzero(seen.any(axis=1) & (first < config.blind * at.shape[1]))
        columns = first[rows] + config.edge
        here = (columns + config.step < at.shape[1]) & on[
            rows, np.minimum(columns, at.shape[1] - 1)
        ]
        rows, columns = rows[here], columns[here]
        there = on[rows, columns + config.step]
        border, inner = at[rows, columns][there], at[rows, columns + config.step][there]
        way = border - inner
        far = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        corners += [border, border + config.beyond * way / far]
    return convex_hull(np.concatenate(corners))
