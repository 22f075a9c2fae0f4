"""Convex outlines in the plane: corners (m, 2), counterclockwise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library

Array = NDArray[np.float64]


def corners_of(hull: Array) -> Array:
    """The corners of the region within half planes (m, 3): a x + b y + c <= 0."""
    spatial = import_library("scipy.spatial")
    # The middle of the largest circle within maximises r where a x + b y + c + r <= 0.
    sides = np.column_stack([hull[:, :2], np.ones(len(hull))])
    found = import_library("scipy.optimize").linprog(
        [0, 0, -1], sides, -hull[:, 2], bounds=(None, None)
    )
    points = spatial.HalfspaceIntersection(hull, found.x[:2]).intersections
    return np.asarray(points[spatial.ConvexHull(points).vertices], dtype=np.float64)


def plain(outline: Array, share: float, tolerance: float) -> Array:
    """The smallest rectangle around an outline that fills `share` of it, or else the outline
    without corners that matter by less than `tolerance`."""
    box = rectangle(outline, share)
    if box is not None:
        return box
    closed = np.concatenate([outline, outline[:1]])
    approximate = import_library("skimage.measure").approximate_polygon
    return np.asarray(approximate(closed, tolerance)[:-1], dtype=np.float64)


def rectangle(outline: Array, share: float) -> Array | None:
    """The smallest rectangle (4, 2) around an outline, or what is within it, if its hull fills
    `share` of that."""
    from trimesh.bounds import oriented_bounds_2D

    T_box_plan, size = oriented_bounds_2D(outline)
    if import_library("scipy.spatial").ConvexHull(outline).volume < share * np.prod(size):
        return None
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2
    return np.asarray((box - T_box_plan[:2, 2]) @ T_box_plan[:2, :2], dtype=np.float64)


def normals_of(outline: Array) -> Array:
    """(m, 2) unit, outward, of the side from each corner to the next."""
    along = np.roll(outline, -1, axis=0) - outline
    normals = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def shifted(outline: Array, out: float) -> Array:
    """An outline with as many corners, of which each side is moved outwards by `out`."""
    normals = normals_of(outline)
    offsets = (normals * outline).sum(axis=1) + out
    # Each corner lies on the side before it and on its own.
    both = np.stack([np.roll(normals, 1, axis=0), normals], axis=1)
    sides = np.stack([np.roll(offsets, 1), offsets], axis=1)
    return np.asarray(np.linalg.solve(both, sides[..., None])[..., 0])
