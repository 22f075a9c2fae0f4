"""Curved surfaces fitted to the neighbourhoods of pixels, in one loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]

# Of the six coefficients' fit, and some more to tell whether it fits.
LEAST_NEIGHBOURS = 10.0
# Share of the neighbours' count. Below it they lie in a line, or along the mask's outline.
LEAST_PIVOT = 0.002


@compiled
def surfaces_fitted(
    inverse: Array, deviation: Array, radii: NDArray[np.int64], gate: float, fit: float
) -> Array:
    """Each pixel's value on the quadratic function of the pixel that fits its neighbours best.

    inverse : (H, W) 1 / z, NaN where a pixel has no say and is not asked; deviation : (H, W) of it
    radii : (r,) pixels, ascending. The function of the largest is taken before which all have
        fitted; a pixel with none keeps its value.
    gate : neighbours that are so many deviations off the plane through those of the radius before
        have no say; at first, three times as many off the pixel's own value
    fit : a function fits if the variance about it is at most so many times that of the noise
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
                moments[:] = 0.0
                right[:] = 0.0
                n = square = noise = 0.0
                for y in range(max(row - radius, 0), min(row + radius + 1, height)):
                    v = (y - row) / radius
                    for x in range(max(column - radius, 0), min(column + radius + 1, width)):
                        u = (x - column) / radius
                        if u * u + v * v > 1.0 + 0.5 / (radius * radius):
                            continue
                        d = inverse[y, x] - own
                        if np.isnan(d):
                            continue
                        terms[0], terms[1], terms[2] = 1.0, u, v
                        terms[3], terms[4], terms[5] = u * u, u * v, v * v
                        s = deviation[y, x]
                        off = d - plane[0] - plane[1] * (x - column) - plane[2] * (y - row)
                        if abs(off) > reach * s:
                            continue
                        for i in range(6):
                            for j in range(i + 1):
                                moments[i, j] += terms[i] * terms[j]
                            right[i] += terms[i] * d
                        n += 1.0
                        square += d * d
                        noise += s * s
                if n < LEAST_NEIGHBOURS:
                    break
                # Cholesky's decomposition: moments = root root^T.
                solvable = True
                for i in range(6):
                    for j in range(i + 1):
                        total = moments[i, j]
                        for k in range(j):
                            total -= root[i, k] * root[j, k]
                        if i > j:
                            root[i, j] = total / root[j, j]
                        elif total > LEAST_PIVOT * n:
                            root[i, i] = np.sqrt(total)
                        else:
                            solvable = False
                            break
                    if not solvable:
                        break
                if not solvable:
                    break
                explained = 0.0
                for i in range(6):
                    total = right[i]
                    for k in range(i):
                        total -= root[i, k] * terms[k]
                    terms[i] = total / root[i, i]
                    explained += terms[i] * terms[i]
                if square - explained > fit * noise * (n - 6.0) / n:
                    break
                for i in range(5, -1, -1):
                    total = terms[i]
                    for k in range(i + 1, 6):
                        total -= root[k, i] * curved[k]
                    curved[i] = total / root[i, i]
                found[row, column] = own + curved[0]
                # The plane is the same without the last three terms.
                for i in range(2, -1, -1):
                    total = terms[i]
                    for k in range(i + 1, 3):
                        total -= root[k, i] * plane[k]
                    plane[i] = total / root[i, i]
                plane[1] /= radius
                plane[2] /= radius
                reach = gate
    return found
