"""Curved surfaces fitted to the neighbourhoods of pixels, in one loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]


@compiled
def surfaces_fitted(
    inverse: Array,
    deviation: Array,
    radii: NDArray[np.int64],
    gate: float,
    fit: float,
    least_neighbours: int,
    least_pivot: float,
) -> Array:
    """Each pixel's value on the quadratic function of the pixel that fits its neighbours best.

    inverse : (H, W) 1 / z, NaN where a pixel has no say and is not asked; deviation : (H, W) of it
    radii : (r,) pixels, ascending. The function of the largest is taken before which all have
        fitted; a pixel with none keeps its value.
    gate : neighbours that are so many deviations off the plane through those of the radius before
        have no say; at first, three times as many off the pixel's own value
    fit : a function fits if the variance about it is at most so many times that of the noise
    least_neighbours, least_pivot : as of `FittedDepthConfig`
    """
    height, width = inverse.shape
    found = inverse.copy()
    terms, plane, curved = np.empty(6), np.empty(3), np.empty(6)
    moments, right, root = np.empty((6, 6)), np.empty(6), np.empty((6, 6))
    for row in range(height):
        for column in range(width):
            own = inverse[row, column]
            if np.isnan(own):
                continue
            # Slopes by the pixel, of the values less the pixel's own.
            plane[:] = 0.0
            reach = 3.0 * gate
            for radius in radii:
                n, square, noise = _gathered(
                    inverse, deviation, row, column, radius, plane, reach, moments, right
                )
                if n < least_neighbours or not _decomposed(moments, least_pivot * n, root):
                    break
                explained = _halfway(root, right, terms)
                if square - explained > fit * noise * (n - 6.0) / n:
                    break
                _solved(root, terms, 6, curved)
                found[row, column] = own + curved[0]
                # The plane is the same without the last three terms.
                _solved(root, terms, 3, plane)
                plane[1] /= radius
                plane[2] /= radius
                reach = gate
    return found


@compiled
def _gathered(
    inverse: Array,
    deviation: Array,
    row: int,
    column: int,
    radius: int,
    plane: Array,
    reach: float,
    moments: Array,
    right: Array,
) -> tuple[float, float, float]:
    """Normal equations of the terms 1, u, v, u^2, u v and v^2, (u, v) in radii from the pixel, over
    the neighbours that are at most `reach` deviations off the plane: into the lower half of
    `moments` (6, 6) and into `right` (6,).

    Returns the neighbours' count, and their sums of squares and of variances.
    """
    height, width = inverse.shape
    own = inverse[row, column]
    # Numbers of their own, not in an array: only those are kept in registers.
    n = m1 = m2 = m3 = m4 = m5 = m6 = m7 = m8 = m9 = 0.0
    m10 = m11 = m12 = m13 = m14 = square = noise = 0.0
    r0 = r1 = r2 = r3 = r4 = r5 = 0.0
    for y in range(max(row - radius, 0), min(row + radius + 1, height)):
        v = (y - row) / radius
        for x in range(max(column - radius, 0), min(column + radius + 1, width)):
            u = (x - column) / radius
            if u * u + v * v > 1.0 + 0.5 / (radius * radius):
                continue
            d = inverse[y, x] - own
            if np.isnan(d):
                continue
            s = deviation[y, x]
            off = d - plane[0] - plane[1] * (x - column) - plane[2] * (y - row)
            if abs(off) > reach * s:
                continue
            uu, uv, vv = u * u, u * v, v * v
            n, m1, m2, m3, m4, m5 = n + 1.0, m1 + u, m2 + v, m3 + uu, m4 + uv, m5 + vv
            m6, m7, m8, m9 = m6 + uu * u, m7 + uu * v, m8 + uv * v, m9 + vv * v
            m10, m11, m12 = m10 + uu * uu, m11 + uu * uv, m12 + uu * vv
            m13, m14 = m13 + uv * vv, m14 + vv * vv
            r0, r1, r2 = r0 + d, r1 + u * d, r2 + v * d
            r3, r4, r5 = r3 + uu * d, r4 + uv * d, r5 + vv * d
            square += d * d
            noise += s * s
    moments[0, 0] = n
    moments[1, 0], moments[1, 1] = m1, m3
    moments[2, 0], moments[2, 1], moments[2, 2] = m2, m4, m5
    moments[3, 0], moments[3, 1], moments[3, 2], moments[3, 3] = m3, m6, m7, m10
    moments[4, 0], moments[4, 1], moments[4, 2], moments[4, 3] = m4, m7, m8, m11
    moments[5, 0], moments[5, 1], moments[5, 2], moments[5, 3] = m5, m8, m9, m12
    moments[4, 4], moments[5, 4], moments[5, 5] = m12, m13, m14
    right[0], right[1], right[2] = r0, r1, r2
    right[3], right[4], right[5] = r3, r4, r5
    return n, square, noise


@compiled
def _decomposed(moments: Array, least: float, root: Array) -> bool:
    """Cholesky's decomposition, moments = root root^T, into the lower half of `root` (6, 6); False
    where a pivot is not above `least`."""
    for i in range(6):
        for j in range(i + 1):
            total = moments[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            if i > j:
                root[i, j] = total / root[j, j]
            elif total > least:
                root[i, i] = np.sqrt(total)
            else:
                return False
    return True


@compiled
def _halfway(root: Array, right: Array, terms: Array) -> float:
    """`terms` (6,) of root terms = right, and what they explain of the sum of squares."""
    explained = 0.0
    for i in range(6):
        total = right[i]
        for k in range(i):
            total -= root[i, k] * terms[k]
        terms[i] = total / root[i, i]
        explained += terms[i] * terms[i]
    return explained


@compiled
def _solved(root: Array, terms: Array, count: int, found: Array) -> None:
    """Coefficients (count,) of root^T found = terms, of the first `count` terms alone."""
    for i in range(count - 1, -1, -1):
        total = terms[i]
        for k in range(i + 1, count):
            total -= root[k, i] * found[k]
        found[i] = total / root[i, i]
