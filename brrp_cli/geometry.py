"""Transforms and the pinhole camera.

Transforms are named `T_target_source` and are (4, 4) matrices on column vectors. The camera frame
is x right, y down, z forward (ROS optical frame); pixel (u, v) is column u, row v.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrp_cli.errors import BrrpError

Array = NDArray[np.floating]
Number = TypeVar("Number", bound=np.generic)
# Cells of a grid for each point, up to which they are counted.
_COUNTED = 4

# Up in the image, where no table says it: cameras look along z, with y down.
IMAGE_UP = np.array([0.0, -1.0, 0.0])


def as_points(points: ArrayLike) -> Array:
    """Points (n, 3) as an array. Errors: BrrpError for anything else."""
    try:
        found = np.asarray(points)
    except ValueError:  # rows of several lengths
        found = np.empty(0, dtype=object)
    if found.ndim == 2 and found.shape[1] == 3 and found.dtype.kind in "iuf":
        return found
    numbers = found.dtype.kind in "iuf"
    raise BrrpError(
        "These are no points",
        expected="numbers (n, 3): metres, camera frame",
        found=f"an array {found.shape}" if numbers else "what makes no array of numbers",
        fix="give one point as [[x, y, z]]"
        if numbers and found.shape == (3,)
        else "give x, y and z of each point: [[x, y, z], ...]",
    )


def transform_points(T_target_source: Array, points: Array) -> Array:
    """Points (..., 3) in the source frame, given in the target frame."""
    return points @ T_target_source[:3, :3].T + T_target_source[:3, 3]


def inverse(T_target_source: NDArray[np.floating]) -> NDArray[np.float64]:
    """T_source_target (4, 4)."""
    return np.asarray(np.linalg.inv(T_target_source), dtype=np.float64)


def grid_nodes(axes: Iterable[NDArray[Number]]) -> NDArray[Number]:
    """Nodes (n1, ..., nd, d) of a grid with the coordinates (n1,), ..., (nd,) along each axis."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def moved_box(T_target_source: Array, box: NDArray[np.float64]) -> NDArray[np.float64]:
    """The box (2, 3) along the target frame's axes around a box (2, 3) of the source frame."""
    corners = grid_nodes(box.T).reshape(-1, 3)
    return np.stack(bounds(transform_points(T_target_source, corners)))


def similarity(
    scale: float = 1.0, rotation: Array | None = None, translation: Array | None = None
) -> NDArray[np.float64]:
    """(4, 4) matrix of x -> scale * rotation @ x + translation."""
    T = np.eye(4)
    T[:3, :3] *= scale
    if rotation is not None:
        T[:3, :3] = scale * np.asarray(rotation, dtype=np.float64)
    if translation is not None:
        T[:3, 3] = translation
    return T


def as_transforms(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 4, 4) matrices that turn about the origin by rotations (K, 3, 3)."""
    T = np.tile(np.eye(4), (len(rotations), 1, 1))
    T[:, :3, :3] = rotations
    return T


def turns_about(rotations: NDArray[np.float64], middle: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 4, 4) matrices that turn about a point (3,) by rotations (K, 3, 3)."""
    T = as_transforms(rotations)
    T[:, :3, 3] = middle - rotations @ middle
    return T


def turn_about_z(angle: float) -> NDArray[np.float64]:
    """(3, 3) rotation by `angle` radians about z, from x towards y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_angle(rotation: Array) -> float:
    """Radians by which a rotation (3, 3) turns, 0 to pi."""
    return float(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1)))


def cells_of(points: NDArray[np.floating], cell: float) -> NDArray[np.int64]:
    """(n,) number, from 0 on and without gaps, of the grid cell of `cell` that each of points
    (n, d) lies in; in the order of the cells, the last coordinate fastest."""
    if not len(points):
        return np.empty(0, np.int64)
    cells = np.floor(points / cell).astype(np.int64)
    first, last = bounds(cells)
    cells -= first
    size = last - first + 1
    index = np.ravel_multi_index(tuple(cells.T), tuple(size))
    if np.prod(size, dtype=np.float64) > _COUNTED * len(points):
        return np.unique(index, return_inverse=True)[1].reshape(-1)
    # Counted rather than sorted, in a quarter of the time.
    held = np.bincount(index) > 0
    return (np.cumsum(held) - 1)[index]


def bounds(points: NDArray[Number]) -> tuple[NDArray[Number], NDArray[Number]]:
    """The least and the greatest (d,) of each coordinate of points (n, d)."""
    # By column: NumPy takes rows of two or three numbers one at a time, fifteen times as slow.
    columns = points.T
    least, most = ([reduce(each) for each in columns] for reduce in (np.min, np.max))
    return np.array(least, points.dtype), np.array(most, points.dtype)


def within(
    points: NDArray[np.number], least: NDArray[np.number], most: NDArray[np.number]
) -> NDArray[np.bool_]:
    """(n,) whether each coordinate of points (n, d) is at least (d,) and at most (d,)."""
    inside = np.ones(len(points), dtype=bool)
    for column, low, high in zip(points.T, least, most, strict=True):
        inside &= (column >= low) & (column <= high)
    return inside


def backproject(depth: Array, K: Array) -> NDArray[np.float32]:
    """Depth (H, W), metres along z, to points (H, W, 3), metres, camera frame.

    Pixels without depth (0, negative, NaN or inf) become NaN.
    """
    height, width = depth.shape
    z = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan).astype(np.float64)
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    x = (u - K[0, 2]) / K[0, 0] * z
    y = (v - K[1, 2]) / K[1, 1] * z
    return np.stack([x, y, z], axis=-1).astype(np.float32)


def project(points: Array, K: Array) -> NDArray[np.float64]:
    """Points (n, 3), camera frame, to pixels (n, 2) as (u, v)."""
    z = points[:, 2:3]
    return points[:, :2] / z * np.array([K[0, 0], K[1, 1]]) + np.array([K[0, 2], K[1, 2]])


def lengths(vectors: Array) -> Array:
    """(n,) of vectors (n, 3), as `np.linalg.norm` has them, and a few times as fast."""
    x, y, z = vectors.T
    square = x * x
    square += y * y
    square += z * z
    return np.sqrt(square, out=square)


def bell(ratios: Array) -> Array:
    """exp(-ratios^2 / 2), but no less than exp(-80): what is smaller float32 holds as a denormal
    number, which is slow, or not at all."""
    return np.exp(np.maximum(-0.5 * np.square(ratios), -80.0))


def normalise(vectors: Array) -> NDArray[np.float64]:
    """Unit vectors along `vectors` (..., 3); zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0), dtype=np.float64)
