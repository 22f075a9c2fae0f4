"""How observed points pull on a placement along their rays, as machine code. See `compiled`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]


@compiled
def pull_of_rays(
    points: Array,
    on_surface: Array,
    away: Array,
    middle: Array,
    along: Array,
    pixel: float,
    outlier: float,
    independent: float,
) -> tuple[float, Array, Array]:
    """What the residuals cost, nats, and the normal equations, (6, 6) and (6,), of the turn about
    `middle` (3,), radians, and the shift, metres, that bring a surface to observed points (n, 3),
    camera frame.

    on_surface, away : (n, 3) where each point's ray meets it, and its unit normal there; along :
    (n,) metres, standard deviation of a point along its ray; pixel : the width of one, metres, at
    one metre
    outlier : standard deviations beyond which a point does not pull (Tukey's biweight);
    independent : the share of the points that counts
    """
    normal, fall = np.zeros((6, 6)), np.zeros(6)
    row, cost, most = np.empty(6), 0.0, outlier * outlier / 6
    for n in range(len(points)):
        p, s, a = points[n], on_surface[n], away[n]
        residual = (p[0] - s[0]) * a[0] + (p[1] - s[1]) * a[1] + (p[2] - s[2]) * a[2]
        length = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        cosine = (p[0] * a[0] + p[1] * a[1] + p[2] * a[2]) / length
        # Depth is off along the ray, and the ray by a pixel across.
        through = along[n] * cosine
        across = p[2] * pixel
        variance = through * through + across * across * max(0.0, 1 - cosine * cosine)
        share = max(0.0, 1 - residual * residual / (outlier * outlier * variance))
        cost += independent * most * (1 - share * share * share)
        if share == 0:
            continue
        weight = independent * share * share / variance
        x, y, z = s[0] - middle[0], s[1] - middle[1], s[2] - middle[2]
        row[0], row[1], row[2] = y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0]
        row[3], row[4], row[5] = a[0], a[1], a[2]
        for i in range(6):
            fall[i] += weight * row[i] * residual
            for j in range(6):
                normal[i, j] += weight * row[i] * row[j]
    return cost, normal, fall
