"""What is printed on a placed object, held against the image, as machine code. See `compiled`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]

# Columns of what is found: the correlation, the standard deviations of the stored colours and of
# the image's, and how many cells of the surface the camera sees.
CORRELATION, STORED, IMAGE, CELLS = 0, 1, 2, 3
# Added for each point to the squares of the normals: where all of them are one, light is no more
# than a mean.
_FLAT = 0.003


@compiled
def _lit(normals: Array, bright: Array) -> Array:
    """(4, 2) how brightness (n, 2) depends on the normals (n, 3): by how much it grows with each
    component, and what it is without, by least squares."""
    xx, xy, xz, yy, yz, zz, x, y, z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    products = np.zeros((4, 2))
    # Sums in an array of their own take a quarter longer.
    for n in range(len(normals)):
        a, b, c = normals[n, 0], normals[n, 1], normals[n, 2]
        xx, xy, xz = xx + a * a, xy + a * b, xz + a * c
        yy, yz, zz = yy + b * b, yz + b * c, zz + c * c
        x, y, z = x + a, y + b, z + c
        for j in range(2):
            value = bright[n, j]
            products[0, j] += a * value
            products[1, j] += b * value
            products[2, j] += c * value
            products[3, j] += value
    count = float(len(normals))
    flat = _FLAT * count
    squares = np.array(
        [
            [xx + flat, xy, xz, x],
            [xy, yy + flat, yz, y],
            [xz, yz, zz + flat, z],
            [x, y, z, count],
        ]
    )
    products[:] = np.linalg.solve(squares, products)
    return products


@compiled
def agreements(
    T_cam_model: Array,
    points: Array,
    normals: Array,
    offsets: Array,
    colours: Array,
    cell: NDArray[np.int64],
    rgb: NDArray[np.uint8],
    depth: NDArray[np.floating],
    lost: NDArray[np.bool_],
    K: Array,
    opponent: Array,
    curve: Array,
    near: float,
    least: int,
    channels: int,
) -> Array:
    """(B, 4) of placements (B, 4, 4): see the columns above; 0 where fewer than `least` points are
    seen. Colours are means over cells, each channel about its own mean, and brightness about what
    light from one side would make of it, of what is seen.

    points, normals : (n, 3) metres, model's axes; offsets : (n,) of the planes through them, seen
    from where the camera is beyond; colours : (n, 3) stored, on the scale of `curve`, along
    `opponent` (3, 3), whose first row is brightness; cell : (n,) numbers, from 0 on, of the cells
    of the surface
    rgb, depth, lost : (H, W, 3), (H, W) metres, (H, W): a point is seen where the measured depth is
    within `near` metres of it, or where that is lost
    curve : (256,) what values of the image become; channels : of the colours that are compared, the
    first ones
    """
    height, width = depth.shape
    found = np.zeros((len(T_cam_model), 4))
    seen, pixel = np.empty(len(points), np.int64), np.empty((len(points), 3))
    toward, bright = np.empty((len(points), 3)), np.empty((len(points), 2))
    count = np.zeros(cell.max() + 1)
    sums = np.zeros((2, len(count), 3))
    eye = np.empty(3)
    for b in range(len(T_cam_model)):
        T = T_cam_model[b]
        square = T[0, 0] ** 2 + T[1, 0] ** 2 + T[2, 0] ** 2
        for i in range(3):
            eye[i] = -(T[0, i] * T[0, 3] + T[1, i] * T[1, 3] + T[2, i] * T[2, 3]) / square
        total = 0
        for n in range(len(points)):
            p, a = points[n], normals[n]
            if a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2] <= offsets[n]:
                continue
            z = T[2, 0] * p[0] + T[2, 1] * p[1] + T[2, 2] * p[2] + T[2, 3]
            if z <= 0:
                continue
            x = T[0, 0] * p[0] + T[0, 1] * p[1] + T[0, 2] * p[2] + T[0, 3]
            y = T[1, 0] * p[0] + T[1, 1] * p[1] + T[1, 2] * p[2] + T[1, 3]
            u, v = np.rint(x / z * K[0, 0] + K[0, 2]), np.rint(y / z * K[1, 1] + K[1, 2])
            if not (0 <= u < width and 0 <= v < height):
                continue
            row, column = int(v), int(u)
            if not (abs(depth[row, column] - z) < near or lost[row, column]):
                continue
            for i in range(3):
                pixel[total, i] = 0.0
                for j in range(3):
                    pixel[total, i] += opponent[i, j] * curve[rgb[row, column, j]]
            bright[total, 0], bright[total, 1] = colours[n, 0], pixel[total, 0]
            toward[total] = a
            seen[total] = n
            total += 1
        if total < least:
            continue
        lit = _lit(toward[:total], bright[:total])
        count[:] = 0
        sums[:] = 0
        mean = np.zeros((2, 3))
        for t in range(total):
            n = seen[t]
            count[cell[n]] += 1
            for i in range(channels):
                one, other = colours[n, i], pixel[t, i]
                if i == 0:
                    a = toward[t]
                    one -= a[0] * lit[0, 0] + a[1] * lit[1, 0] + a[2] * lit[2, 0] + lit[3, 0]
                    other -= a[0] * lit[0, 1] + a[1] * lit[1, 1] + a[2] * lit[2, 1] + lit[3, 1]
                sums[0, cell[n], i] += one
                sums[1, cell[n], i] += other
                mean[0, i] += one / total
                mean[1, i] += other / total
        both, one_square, other_square, cells = 0.0, 0.0, 0.0, 0
        for c in range(len(count)):
            if count[c] == 0:
                continue
            cells += 1
            for i in range(channels):
                one = sums[0, c, i] / count[c] - mean[0, i]
                other = sums[1, c, i] / count[c] - mean[1, i]
                both += count[c] * one * other
                one_square += count[c] * one * one
                other_square += count[c] * other * other
        spread = math.sqrt(one_square * other_square)
        found[b, 0] = both / spread if spread > 0 else 0.0
        found[b, 1] = math.sqrt(one_square / (3 * total))
        found[b, 2] = math.sqrt(other_square / (3 * total))
        found[b, 3] = cells
    return found
