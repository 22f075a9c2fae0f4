"""Loops over placements and points in grids of signed distances, as machine code.

A grid has nodes lower + spacing * (i, j, k). Distances between nodes are trilinear; off the grid,
that of its nearest point and the way there. All in one file: see `compiled`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# What rounding leaves of a positive number that is next to nothing.
TINY = 1e-30
# A ray that is followed through distances: metres that it goes on at least, and how often.
SHORTEST_STEP = 0.001
LONGEST_WALK = 60


@compiled
def _cell(at: float, count: int) -> tuple[int, float, float]:
    """Of a coordinate in nodes: its cell, how far along that it lies, and how far off the grid."""
    within = min(max(at, 0.0), count - 1.0)
    cell = min(int(within), count - 2)
    return cell, within - cell, at - within


@compiled
def _corners(
    values: Floats, shape: tuple[int, int, int], i: int, j: int, k: int
) -> tuple[float, float, float, float, float, float, float, float]:
    """Distances at the corners of a cell, the last axis first; values : of all nodes in a row."""
    # Numbers without a sign need no check whether they count from the end.
    first = np.uintp((i * shape[1] + j) * shape[2] + k)
    one, row, layer = np.uintp(1), np.uintp(shape[2]), np.uintp(shape[1] * shape[2])
    second, third, fourth = first + row, first + layer, first + layer + row
    return (
        float(values[first]),
        float(values[first + one]),
        float(values[second]),
        float(values[second + one]),
        float(values[third]),
        float(values[third + one]),
        float(values[fourth]),
        float(values[fourth + one]),
    )


@compiled
def _distance(
    values: Floats, shape: tuple[int, int, int], spacing: float, x: float, y: float, z: float
) -> float:
    """At a point in nodes; values : of all nodes in a row. `_look_up` for those who need no
    gradient, in half the time."""
    i, x, off_x = _cell(x, shape[0])
    j, y, off_y = _cell(y, shape[1])
    k, z, off_z = _cell(z, shape[2])
    a, a1, b, b1, c, c1, d, d1 = _corners(values, shape, i, j, k)
    a, b, c, d = a + z * (a1 - a), b + z * (b1 - b), c + z * (c1 - c), d + z * (d1 - d)
    near, far = a + y * (b - a), c + y * (d - c)
    off = off_x * off_x + off_y * off_y + off_z * off_z
    value = near + x * (far - near)
    return value + math.sqrt(off) * spacing if off > 0 else value


@compiled
def _look_up(
    values: Floats, shape: tuple[int, int, int], spacing: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Distance and gradient at a point in nodes; values : of all nodes in a row."""
    nodes = 1 / spacing
    i, x, off_x = _cell(x, shape[0])
    j, y, off_y = _cell(y, shape[1])
    k, z, off_z = _cell(z, shape[2])
    a, a1, b, b1, c, c1, d, d1 = _corners(values, shape, i, j, k)
    rise_a, rise_b, rise_c, rise_d = a1 - a, b1 - b, c1 - c, d1 - d
    a, b, c, d = a + z * rise_a, b + z * rise_b, c + z * rise_c, d + z * rise_d
    left, right = b - a, d - c
    near, far = a + y * left, c + y * right
    up_near, up_far = rise_a + y * (rise_b - rise_a), rise_c + y * (rise_d - rise_c)
    value = near + x * (far - near)
    gx = (far - near) * nodes
    gy = (left + x * (right - left)) * nodes
    gz = (up_near + x * (up_far - up_near)) * nodes
    if off_x != 0 or off_y != 0 or off_z != 0:
        way = math.sqrt(off_x * off_x + off_y * off_y + off_z * off_z)
        value += way * spacing
        gx = off_x / way if off_x != 0 else gx
        gy = off_y / way if off_y != 0 else gy
        gz = off_z / way if off_z != 0 else gz
    return value, gx, gy, gz


@compiled
def _in_nodes(
    x: float, y: float, z: float, lower: Array, nodes: float
) -> tuple[float, float, float]:
    """A point of a grid with so many nodes in each of its units, in nodes."""
    return (x - lower[0]) * nodes, (y - lower[1]) * nodes, (z - lower[2]) * nodes


@compiled
def distances(values: Floats, lower: Array, spacing: float, points: Floats) -> Floats:
    """Distance (n,) at points (3, n)."""
    found = np.empty(points.shape[1], np.float32)
    flat, nodes = values.ravel(), 1 / spacing
    for n in range(points.shape[1]):
        x, y, z = _in_nodes(points[0, n], points[1, n], points[2, n], lower, nodes)
        found[n] = _distance(flat, values.shape, spacing, x, y, z)
    return found


@compiled
def distances_and_gradients(
    values: Floats, lower: Array, spacing: float, points: Floats
) -> tuple[Floats, Floats]:
    """Distance (n,) and gradient (3, n) at points (3, n)."""
    found = np.empty(points.shape[1], np.float32)
    slope = np.empty(points.shape, np.float32)
    flat, nodes = values.ravel(), 1 / spacing
    for n in range(points.shape[1]):
        x, y, z = _in_nodes(points[0, n], points[1, n], points[2, n], lower, nodes)
        found[n], slope[0, n], slope[1, n], slope[2, n] = _look_up(
            flat, values.shape, spacing, x, y, z
        )
    return found, slope


@compiled
def nearest_along(
    values: Floats,
    lower: Array,
    spacing: float,
    unit: float,
    T_model_cam: Array,
    rays: Array,
) -> tuple[Array, Array]:
    """Along rays (n, 3) from the camera, z = 1, as far as they are in the grid: the least distance
    to the surface, metres, and the depth where that is, (n,) each; inf for rays that miss the grid,
    and a ray ends where it enters the surface.

    T_model_cam : (4, 4) rigid; unit : metres of one unit of the grid
    """
    least, at = np.full(len(rays), np.inf), np.full(len(rays), np.inf)
    flat = values.ravel()
    grid = _to_nodes(T_model_cam, lower, 1 / spacing, unit)
    way = np.empty(3)
    for n in range(len(rays)):
        length = 0.0
        for i in range(3):
            way[i] = grid[i, 0] * rays[n, 0] + grid[i, 1] * rays[n, 1] + grid[i, 2] * rays[n, 2]
            length += way[i] * way[i]
        # Metres of the model for one of depth.
        length = math.sqrt(length) * spacing * unit
        z, end = _within(grid[:, 3], way, values.shape)
        for _ in range(LONGEST_WALK):
            if z > end:
                break
            x, y, w = grid[0, 3] + z * way[0], grid[1, 3] + z * way[1], grid[2, 3] + z * way[2]
            off = _distance(flat, values.shape, spacing, x, y, w) * unit
            if off < least[n]:
                least[n], at[n] = off, z
            if off <= 0:
                break
            z += max(off, SHORTEST_STEP) / length
    return least, at


@compiled
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


@compiled
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
    for b in range(len(T_model_cam)):
        T = T_model_cam[b]
        a = T[:3, :3]
        det = (
            a[0, 0] * (a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1])
            - a[0, 1] * (a[1, 0] * a[2, 2] - a[1, 2] * a[2, 0])
            + a[0, 2] * (a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0])
        )
        metres = unit / det ** (1 / 3)
        grid = _to_nodes(T, lower, nodes, unit)
        total = 0.0
        for n in range(len(seen)):
            x, y, z = _moved(grid, seen[n, 0], seen[n, 1], seen[n, 2])
            off = abs(_distance(flat, values.shape, spacing, x, y, z)) * metres
            # See `geometry.bell`; beyond, it is next to nothing, and takes its time.
            if off < 6 * near:
                total += math.exp(-0.5 * (off / near) ** 2)
            total -= distance * min(off / far, 1.0)
        found[b] = total / len(seen)
    return found


@compiled
def _to_nodes(T: Array, lower: Array, nodes: float, unit: float) -> Array:
    """(3, 4), from metres to nodes: T (4, 4), and then from metres to nodes of a grid with so many
    of them in each of its units."""
    grid = T[:3] * (nodes / unit)
    for axis in range(3):
        grid[axis, 3] -= lower[axis] * nodes
    return grid


@compiled
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
    height, width = depth.shape
    found = np.empty(len(T_cam_model))
    for b in range(len(T_cam_model)):
        T = T_cam_model[b]
        total = 0.0
        for m in range(len(surface)):
            x, y, z = _moved(T, surface[m, 0], surface[m, 1], surface[m, 2])
            below = -(normal[0] * x + normal[1] * y + normal[2] * z + offset)
            total += min(max((below - tolerance) / slope, 0.0), 1.0)
            if z <= 0:
                continue
            away = 1 / z
            u = np.rint(x * away * K[0, 0] + K[0, 2])
            v = np.rint(y * away * K[1, 1] + K[1, 2])
            if u >= 0 and u < width and v >= 0 and v < height:
                gap = depth[int(v), int(u)] - z
                # Where no depth is, nothing speaks against it.
                if gap > tolerance:
                    total += min((gap - tolerance) / slope, 1.0)
        found[b] = total / len(surface)
    return found


@compiled
def _moved(T: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@compiled
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
    flat, nodes = values.ravel(), 1 / spacing
    inverse = 1 / unit
    normal, fall = np.empty((unknowns, unknowns)), np.empty(unknowns)
    row, step = np.empty(7), np.zeros(7)
    for b in range(len(found)):
        T = found[b]
        for _ in range(iterations):
            normal[:], fall[:] = 0.0, 0.0
            for n in range(len(observed)):
                x, y, z = _moved(T, observed[n, 0], observed[n, 1], observed[n, 2])
                at = _in_nodes(x * inverse, y * inverse, z * inverse, lower, nodes)
                value, gx, gy, gz = _look_up(flat, values.shape, spacing, at[0], at[1], at[2])
                value *= unit
                if abs(value) >= reach:
                    continue
                row[0], row[1], row[2] = y * gz - z * gy, z * gx - x * gz, x * gy - y * gx
                row[3], row[4], row[5] = gx, gy, gz
                # Distances count in metres of the camera frame: in the model's, which shrink as it
                # is taken to be larger, every noise would make it so.
                row[6] = x * gx + y * gy + z * gz - value
                for i in range(unknowns):
                    fall[i] += row[i] * value
                    for j in range(i + 1):
                        normal[i, j] += row[i] * row[j]
            trace = 0.0
            for i in range(unknowns):
                trace += normal[i, i]
            for i in range(unknowns):
                # Nothing pulls where the trace is 0.
                normal[i, i] += damping * trace / unknowns + (1.0 if trace == 0 else 0.0)
            _solve(normal, fall)
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


@compiled
def _solve(A: Array, b: Array) -> None:
    """b (n,) becomes the solution of A x = b, in place; A (n, n) is positive definite, and only its
    lower half is read, which becomes its Cholesky factor. LAPACK's takes longer to be compiled in
    than all of this file."""
    for i in range(len(b)):
        for j in range(i + 1):
            rest = A[i, j]
            for k in range(j):
                rest -= A[i, k] * A[j, k]
            A[i, j] = math.sqrt(max(rest, TINY)) if i == j else rest / A[j, j]
        for j in range(i):
            b[i] -= A[i, j] * b[j]
        b[i] /= A[i, i]
    for i in range(len(b) - 1, -1, -1):
        for j in range(i + 1, len(b)):
            b[i] -= A[j, i] * b[j]
        b[i] /= A[i, i]


@compiled
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
