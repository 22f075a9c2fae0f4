"""Loops over placements and points in grids of signed distances, as machine code.

A grid has nodes lower + spacing * (i, j, k). Distances between nodes are trilinear; off the grid,
that of its nearest point and the way there. All in one file: see `compiled`.

Loops over points in a grid have no branches and no calls, so that the compiler does several points
at a time, and are in single precision. Sums of many points are in double.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled_freely, inlined

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
# A number in single precision. NumPy's own type of it takes no part in `min` and `max`.
Single = Any

ZERO, ONE = np.float32(0), np.float32(1)
# What a divisor is at least: what is divided by less is not used.
NEXT_TO_NOTHING = np.float32(1e-20)
# What rounding leaves of a positive number that is next to nothing.
TINY = 1e-30
# A ray that is followed through distances: metres that it goes on at least, and how often.
SHORTEST_STEP = 0.001
LONGEST_WALK = 60


@inlined
def _cell(at: Single, count: int) -> tuple[Single, Single, Single]:
    """Of a coordinate in nodes: its cell, how far along that it lies, and how far off the grid."""
    within = min(max(at, ZERO), np.float32(count - 1))
    cell = min(np.floor(within), np.float32(count - 2))
    return cell, within - cell, at - within


@inlined
def _corners(
    values: Floats, shape: tuple[int, int, int], i: Single, j: Single, k: Single
) -> tuple[Single, Single, Single, Single, Single, Single, Single, Single]:
    """Distances at the corners of a cell, the last axis first; values : of all nodes in a row."""
    node = (i * np.float32(shape[1]) + j) * np.float32(shape[2]) + k
    # Exact up to 2^24; a field has some 60,000 nodes. Numbers without a sign need no check whether
    # they count from the end.
    first = np.uintp(np.uint32(np.int32(node)))
    one, row, layer = np.uintp(1), np.uintp(shape[2]), np.uintp(shape[1] * shape[2])
    second, third, fourth = first + row, first + layer, first + layer + row
    return (
        values[first],
        values[first + one],
        values[second],
        values[second + one],
        values[third],
        values[third + one],
        values[fourth],
        values[fourth + one],
    )


@inlined
def _distance(
    values: Floats, shape: tuple[int, int, int], spacing: Single, x: Single, y: Single, z: Single
) -> Single:
    """At a point in nodes; values : of all nodes in a row. `_look_up` for those who need no
    gradient."""
    i, x, off_x = _cell(x, shape[0])
    j, y, off_y = _cell(y, shape[1])
    k, z, off_z = _cell(z, shape[2])
    a, a1, b, b1, c, c1, d, d1 = _corners(values, shape, i, j, k)
    a, b, c, d = a + z * (a1 - a), b + z * (b1 - b), c + z * (c1 - c), d + z * (d1 - d)
    near, far = a + y * (b - a), c + y * (d - c)
    off = np.sqrt(off_x * off_x + off_y * off_y + off_z * off_z)
    return near + x * (far - near) + off * spacing


@inlined
def _look_up(
    values: Floats, shape: tuple[int, int, int], spacing: Single, x: Single, y: Single, z: Single
) -> tuple[Single, Single, Single, Single]:
    """Distance and gradient at a point in nodes; values : of all nodes in a row."""
    nodes = ONE / spacing
    i, x, off_x = _cell(x, shape[0])
    j, y, off_y = _cell(y, shape[1])
    k, z, off_z = _cell(z, shape[2])
    a, a1, b, b1, c, c1, d, d1 = _corners(values, shape, i, j, k)
    rise_a, rise_b, rise_c, rise_d = a1 - a, b1 - b, c1 - c, d1 - d
    a, b, c, d = a + z * rise_a, b + z * rise_b, c + z * rise_c, d + z * rise_d
    left, right = b - a, d - c
    near, far = a + y * left, c + y * right
    up_near, up_far = rise_a + y * (rise_b - rise_a), rise_c + y * (rise_d - rise_c)
    off = np.sqrt(off_x * off_x + off_y * off_y + off_z * off_z)
    way = ONE / max(off, NEXT_TO_NOTHING)
    return (
        near + x * (far - near) + off * spacing,
        off_x * way if off_x != 0 else (far - near) * nodes,
        off_y * way if off_y != 0 else (left + x * (right - left)) * nodes,
        off_z * way if off_z != 0 else (up_near + x * (up_far - up_near)) * nodes,
    )


@inlined
def _in_nodes(
    x: Single, y: Single, z: Single, lower: Floats, nodes: Single
) -> tuple[Single, Single, Single]:
    """A point of a grid with so many nodes in each of its units, in nodes."""
    return (x - lower[0]) * nodes, (y - lower[1]) * nodes, (z - lower[2]) * nodes


@compiled_freely
def distances(values: Floats, lower: Array, spacing: float, points: Floats) -> Floats:
    """Distance (n,) at points (3, n)."""
    found = np.empty(points.shape[1], np.float32)
    flat, low, nodes = values.ravel(), lower.astype(np.float32), np.float32(1 / spacing)
    for n in range(points.shape[1]):
        x, y, z = _in_nodes(points[0, n], points[1, n], points[2, n], low, nodes)
        found[n] = _distance(flat, values.shape, np.float32(spacing), x, y, z)
    return found


@compiled_freely
def distances_and_gradients(
    values: Floats, lower: Array, spacing: float, points: Floats
) -> tuple[Floats, Floats]:
    """Distance (n,) and gradient (3, n) at points (3, n)."""
    found = np.empty(points.shape[1], np.float32)
    slope = np.empty(points.shape, np.float32)
    flat, low, nodes = values.ravel(), lower.astype(np.float32), np.float32(1 / spacing)
    for n in range(points.shape[1]):
        x, y, z = _in_nodes(points[0, n], points[1, n], points[2, n], low, nodes)
        found[n], slope[0, n], slope[1, n], slope[2, n] = _look_up(
            flat, values.shape, np.float32(spacing), x, y, z
        )
    return found, slope


@compiled_freely
def nearest_along(
    values: Floats,
    lower: Array,
    spacing: float,
    unit: float,
    T_model_cam: Array,
    rays: Array,
) -> tuple[Array, Array]:
    """Along rays (n, 3) from the camera, z = 1, as far as they are in the grid: the least distance
    to the surface, metres, and the depth where that is, (B, n) each; inf for rays that miss the
    grid, and a ray ends where it enters the surface.

    T_model_cam : (B, 4, 4) rigid; unit : metres of one unit of the grid
    """
    shape = len(T_model_cam), len(rays)
    least, at = np.full(shape, np.inf), np.full(shape, np.inf)
    flat, way = values.ravel(), np.empty(3)
    for b in range(len(T_model_cam)):
        grid = _to_nodes(T_model_cam[b], lower, 1 / spacing, unit)
        for n in range(len(rays)):
            for i in range(3):
                way[i] = grid[i, 0] * rays[n, 0] + grid[i, 1] * rays[n, 1] + grid[i, 2] * rays[n, 2]
            least[b, n], at[b, n] = _nearest(flat, values.shape, spacing, unit, grid[:, 3], way)
    return least, at


@inlined
def _nearest(
    flat: Floats,
    shape: tuple[int, int, int],
    spacing: float,
    unit: float,
    start: Array,
    way: Array,
) -> tuple[float, float]:
    """Along one ray, start + z * way, in nodes."""
    least, at = np.inf, np.inf
    # Metres of the model for one of depth.
    length = math.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2) * spacing * unit
    z, end = _within(start, way, shape)
    for _ in range(LONGEST_WALK):
        if z > end:
            break
        x, y, w = start[0] + z * way[0], start[1] + z * way[1], start[2] + z * way[2]
        off = unit * _distance(
            flat, shape, np.float32(spacing), np.float32(x), np.float32(y), np.float32(w)
        )
        if off < least:
            least, at = off, z
        if off <= 0:
            break
        z += max(off, SHORTEST_STEP) / length
    return least, at


@inlined
def _within(start: Array, way: Array, shape: tuple[int, int, int]) -> tuple[float, float]:
    """From where to where, 0 or more, start + z * way, in nodes, is in a grid; the first is the
    larger where it nowhere is."""
    begin, end = 0.0, np.inf
    for i in range(3):
        # What runs along an axis of the grid is all in it, or nowhere.
        slope = way[i] if abs(way[i]) > TINY else TINY
        one, other = -start[i] / slope, (shape[i] - 1 - start[i]) / slope
        begin, end = max(begin, min(one, other)), min(end, max(one, other))
    return begin, end


@compiled_freely
def explained(
    values: Floats,
    lower: Array,
    spacing: float,
    unit: float,
    T_model_cam: Array,
    seen: Array,
    near: float,
    far: float,
    distance: float,
) -> Array:
    """See `Verifier.score`: of placements (B, 4, 4) and observed points (n, 3), (B,); unit : metres
    of one unit of the grid."""
    found = np.empty(len(T_model_cam))
    flat, nodes = values.ravel(), 1 / spacing
    points = np.ascontiguousarray(seen.T).astype(np.float32)
    off = np.empty(len(seen), np.float32)
    for b in range(len(T_model_cam)):
        T = T_model_cam[b]
        a = T[:3, :3]
        det = (
            a[0, 0] * (a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1])
            - a[0, 1] * (a[1, 0] * a[2, 2] - a[1, 2] * a[2, 0])
            + a[0, 2] * (a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0])
        )
        metres = unit / det ** (1 / 3)
        grid = _to_nodes(T, lower, nodes, unit).astype(np.float32)
        _far_off(flat, values.shape, np.float32(spacing), np.float32(metres), grid, points, off)
        like, unlike = 0.0, 0.0
        for n in range(len(off)):
            like += _bell(off[n] / np.float32(near))
        for n in range(len(off)):
            unlike += min(off[n], np.float32(far))
        found[b] = (like - distance * unlike / far) / len(off)
    return found


@inlined
def _bell(ratio: Single) -> Single:
    """exp(-ratio^2 / 2) to within 2e-7, without a call: exp(-u) is the 64th power of exp(-u / 64),
    of which five terms of the series are enough."""
    # Where it ends, the bell is 4e-9.
    u = min(ratio * ratio * np.float32(0.5 / 64), np.float32(0.3))
    bell = ONE - u * np.float32(1 / 5)
    bell = ONE - u * np.float32(1 / 4) * bell
    bell = ONE - u * np.float32(1 / 3) * bell
    bell = ONE - u * np.float32(1 / 2) * bell
    bell = ONE - u * bell
    bell *= bell
    bell *= bell
    bell *= bell
    bell *= bell
    bell *= bell
    return bell * bell


@inlined
def _far_off(
    flat: Floats,
    shape: tuple[int, int, int],
    spacing: Single,
    unit: Single,
    grid: Floats,
    points: Floats,
    off: Floats,
) -> None:
    """How far (n,) points (3, n) are from the surface, in place of `off`; grid : (3, 4), from
    points to nodes; unit : metres of one unit of the grid."""
    a, b, c = grid[0], grid[1], grid[2]
    for n in range(len(off)):
        p, q, r = points[0, n], points[1, n], points[2, n]
        x = a[0] * p + a[1] * q + a[2] * r + a[3]
        y = b[0] * p + b[1] * q + b[2] * r + b[3]
        z = c[0] * p + c[1] * q + c[2] * r + c[3]
        off[n] = abs(_distance(flat, shape, spacing, x, y, z)) * unit


@inlined
def _to_nodes(T: Array, lower: Array, nodes: float, unit: float) -> Array:
    """(3, 4), from metres to nodes: T (4, 4), and then from metres to nodes of a grid with so many
    of them in each of its units."""
    grid = T[:3] * (nodes / unit)
    for axis in range(3):
        grid[axis, 3] -= lower[axis] * nodes
    return grid


@compiled_freely
def refined(
    values: Floats,
    lower: Array,
    spacing: float,
    unit: float,
    T_model_cam: Array,
    observed: Array,
    reach: float,
    iterations: int,
    unknowns: int,
    damping: float,
    still: float,
    most_resized: float,
) -> Array:
    """See `refine_to_sdf`: placements (B, 4, 4) after the steps; unit : metres of one unit of the
    grid; unknowns : 6, or 7 with the size."""
    found = T_model_cam.copy()
    flat, points = values.ravel(), np.ascontiguousarray(observed.T).astype(np.float32)
    normal, fall, step = np.empty((7, 7)), np.empty(7), np.zeros(7)
    own, grid = np.empty((3, 4), np.float32), np.empty((3, 4), np.float32)
    scale = 1 / (spacing * unit)
    for b in range(len(found)):
        T = found[b]
        for _ in range(iterations):
            for i in range(3):
                for j in range(4):
                    own[i, j] = T[i, j]
                    grid[i, j] = T[i, j] * scale
                grid[i, 3] = T[i, 3] * scale - lower[i] / spacing
            _pull(flat, values.shape, spacing, unit, grid, own, points, reach, normal, fall)
            trace = 0.0
            for i in range(unknowns):
                trace += normal[i, i]
            for i in range(unknowns):
                # Nothing pulls where the trace is 0.
                normal[i, i] += damping * trace / unknowns + (1.0 if trace == 0 else 0.0)
            _solve(normal, fall, unknowns)
            for i in range(unknowns):
                step[i] = -fall[i]
            step[6] = min(max(step[6], -most_resized), most_resized)
            _move(T, step)
            largest = 0.0
            for i in range(unknowns):
                largest = max(largest, abs(step[i]))
            if largest <= still:
                break
    return found


@inlined
def _pull(
    flat: Floats,
    shape: tuple[int, int, int],
    spacing: float,
    unit: float,
    grid: Floats,
    T_model_cam: Floats,
    points: Floats,
    reach: float,
    normal: Array,
    fall: Array,
) -> None:
    """The normal equations of the points (3, n) within `reach` of the surface, in place: the lower
    half of `normal` (7, 7), and `fall` (7,), for a turn, a shift, and a change of size.

    grid : (3, 4), from points to nodes. Sums are numbers of their own, not in an array, since only
    those are kept in registers.
    """
    wide, metres, most = np.float32(spacing), np.float32(unit), np.float32(reach)
    px, py, pz = points[0], points[1], points[2]
    a0, a1, a2, a3 = grid[0, 0], grid[0, 1], grid[0, 2], grid[0, 3]
    b0, b1, b2, b3 = grid[1, 0], grid[1, 1], grid[1, 2], grid[1, 3]
    c0, c1, c2, c3 = grid[2, 0], grid[2, 1], grid[2, 2], grid[2, 3]
    T = T_model_cam
    d0, d1, d2, d3 = T[0, 0], T[0, 1], T[0, 2], T[0, 3]
    e0, e1, e2, e3 = T[1, 0], T[1, 1], T[1, 2], T[1, 3]
    g0, g1, g2, g3 = T[2, 0], T[2, 1], T[2, 2], T[2, 3]
    s00 = s10 = s11 = s20 = s21 = s22 = s30 = s31 = s32 = s33 = 0.0
    s40 = s41 = s42 = s43 = s44 = s50 = s51 = s52 = s53 = s54 = s55 = 0.0
    s60 = s61 = s62 = s63 = s64 = s65 = s66 = 0.0
    f0 = f1 = f2 = f3 = f4 = f5 = f6 = 0.0
    for n in range(points.shape[1]):
        p, q, r = px[n], py[n], pz[n]
        value, gx, gy, gz = _look_up(
            flat,
            shape,
            wide,
            a0 * p + a1 * q + a2 * r + a3,
            b0 * p + b1 * q + b2 * r + b3,
            c0 * p + c1 * q + c2 * r + c3,
        )
        value *= metres
        pulls = ONE if abs(value) < most else ZERO
        value, gx, gy, gz = value * pulls, gx * pulls, gy * pulls, gz * pulls
        x = d0 * p + d1 * q + d2 * r + d3
        y = e0 * p + e1 * q + e2 * r + e3
        z = g0 * p + g1 * q + g2 * r + g3
        v, r3, r4, r5 = np.float64(value), np.float64(gx), np.float64(gy), np.float64(gz)
        r0, r1, r2 = y * r5 - z * r4, z * r3 - x * r5, x * r4 - y * r3
        # Distances count in metres of the camera frame: in the model's, which shrink as it is
        # taken to be larger, every noise would make it so.
        r6 = x * r3 + y * r4 + z * r5 - v
        s00, s10, s11 = s00 + r0 * r0, s10 + r1 * r0, s11 + r1 * r1
        s20, s21, s22 = s20 + r2 * r0, s21 + r2 * r1, s22 + r2 * r2
        s30, s31, s32, s33 = s30 + r3 * r0, s31 + r3 * r1, s32 + r3 * r2, s33 + r3 * r3
        s40, s41, s42, s43 = s40 + r4 * r0, s41 + r4 * r1, s42 + r4 * r2, s43 + r4 * r3
        s50, s51, s52, s53 = s50 + r5 * r0, s51 + r5 * r1, s52 + r5 * r2, s53 + r5 * r3
        s44, s54, s55 = s44 + r4 * r4, s54 + r5 * r4, s55 + r5 * r5
        s60, s61, s62, s63 = s60 + r6 * r0, s61 + r6 * r1, s62 + r6 * r2, s63 + r6 * r3
        s64, s65, s66 = s64 + r6 * r4, s65 + r6 * r5, s66 + r6 * r6
        f0, f1, f2, f3 = f0 + r0 * v, f1 + r1 * v, f2 + r2 * v, f3 + r3 * v
        f4, f5, f6 = f4 + r4 * v, f5 + r5 * v, f6 + r6 * v
    normal[0, 0] = s00
    normal[1, 0], normal[1, 1] = s10, s11
    normal[2, 0], normal[2, 1], normal[2, 2] = s20, s21, s22
    normal[3, 0], normal[3, 1], normal[3, 2], normal[3, 3] = s30, s31, s32, s33
    normal[4, 0], normal[4, 1], normal[4, 2], normal[4, 3] = s40, s41, s42, s43
    normal[5, 0], normal[5, 1], normal[5, 2], normal[5, 3] = s50, s51, s52, s53
    normal[6, 0], normal[6, 1], normal[6, 2], normal[6, 3] = s60, s61, s62, s63
    normal[4, 4], normal[5, 4], normal[5, 5] = s44, s54, s55
    normal[6, 4], normal[6, 5], normal[6, 6] = s64, s65, s66
    fall[0], fall[1], fall[2], fall[3] = f0, f1, f2, f3
    fall[4], fall[5], fall[6] = f4, f5, f6


@inlined
def _solve(A: Array, b: Array, n: int) -> None:
    """b (n,) becomes the solution of A x = b, in place; A (n, n) is positive definite, and only its
    lower half is read, which becomes its Cholesky factor. LAPACK's takes longer to be compiled in
    than all of this file."""
    for i in range(n):
        for j in range(i + 1):
            rest = A[i, j]
            for k in range(j):
                rest -= A[i, k] * A[j, k]
            A[i, j] = math.sqrt(max(rest, TINY)) if i == j else rest / A[j, j]
        for j in range(i):
            b[i] -= A[i, j] * b[j]
        b[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= A[j, i] * b[j]
        b[i] /= A[i, i]


@inlined
def _move(T: Array, step: Array) -> None:
    """Turn T (4, 4), in place, by step[:3] (Rodrigues), shift it by step[3:6], and resize it by
    exp(step[6])."""
    angle = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    x, y, z = step[0], step[1], step[2]
    if angle > 0:
        x, y, z = x / angle, y / angle, z / angle
    sine, versine, size = math.sin(angle), 1 - math.cos(angle), math.exp(step[6])
    for column in range(4):
        a, b, c = T[0, column], T[1, column], T[2, column]
        along = (x * a + y * b + z * c) * versine
        keep = 1 - versine
        T[0, column] = size * (keep * a + along * x + sine * (y * c - z * b))
        T[1, column] = size * (keep * b + along * y + sine * (z * a - x * c))
        T[2, column] = size * (keep * c + along * z + sine * (x * b - y * a))
    for axis in range(3):
        T[axis, 3] += step[3 + axis]
