"""The region within a given reach of a placed mesh.

A mesh whose vertices are moved along their normals runs into itself where it is thin or hollow, and
leaves out there what it should hold. The region is taken from signed distances instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import grid_nodes, transform_points
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.reconstruction import Axes
from brrp_cli.surface.alike import every_alike

Array = NDArray[np.float64]

# Metres; nearer to a surface single precision does not tell which way leads away from it.
_CLEAR = 5e-5


def around_axes(shape: PlacedShape, reach: float, config: SurfaceConfig) -> Axes:
    """Axes, metres, camera frame, of a grid that holds the shape and `reach` metres around it."""
    low, high = shape.bounds
    size = high - low + 2 * max(reach, 0.0)
    spacing = max(float((np.prod(size) / config.around_nodes) ** (1 / 3)), config.around_finest)
    edge = max(reach, 0.0) + 2 * spacing
    x, y, z = (
        np.arange(a - edge, b + edge + spacing, spacing) for a, b in zip(low, high, strict=True)
    )
    return x, y, z


def beyond_reach(shape: PlacedShape, reach: Array, axes: Axes, further: float) -> Array:
    """Metres (nx, ny, nz) by which the nodes of a grid lie beyond the reach of the shape's surface,
    negative within it; right from 0 to `further` metres and of the right sign elsewhere.

    reach : (n,) metres by which the region goes beyond each vertex, outwards; that of a face is the
    largest of its corners
    """
    nodes = grid_nodes(axes).reshape(-1, 3)
    local = transform_points(np.linalg.inv(shape.T_cam_shape), nodes)
    spacing = float(axes[0][1] - axes[0][0])
    band = max(float(np.abs(reach).max()), 0.0) + further + 2 * spacing
    field = shape.shape.field
    coarse = field.signed_distance(local)
    beyond = np.where(coarse < 0, -spacing, coarse * shape.unit)
    near = np.flatnonzero(np.abs(coarse) < band / shape.unit + field.spacing * np.sqrt(3))
    distance, face = shape.shape.nearest(local[near])
    corners = shape.shape.faces[face]
    beyond[near] = distance * shape.unit - reach[corners].max(axis=1)
    return np.asarray(beyond.reshape([len(axis) for axis in axes]))


def out_to_reach(shape: PlacedShape, vertices: Array, reach: Array) -> Array:
    """Vertices (m, 3), metres, camera frame, of a surface around the shape, moved away from it as
    far as `reach` says; those that are further out stay.

    Between two nodes the distance from a thin wall is not linear, and marching cubes leave their
    surface inside of where it should be.
    reach : (n,) metres, as in `beyond_reach`
    """
    local = transform_points(np.linalg.inv(shape.T_cam_shape), vertices)
    closest, face = shape.shape.closest(local)
    away = local - closest
    distance = np.linalg.norm(away, axis=1)
    wanted = reach[shape.shape.faces[face]].max(axis=1) / shape.unit
    short = np.flatnonzero(distance < wanted)
    outwards = np.where(shape.shape.inside(local[short]), -1.0, 1.0)
    clear = distance[short] > _CLEAR / shape.unit
    a, b, c = (shape.shape.vertices[corner] for corner in shape.shape.faces[face[short]].T)
    normal = np.cross(b - a, c - a)
    way = np.where(clear[:, None], outwards[:, None] * away[short], normal)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    local[short] = closest[short] + wanted[short, None] * way
    return np.asarray(transform_points(shape.T_cam_shape, local))


def reach_of_alike(shape: PlacedShape, config: SurfaceConfig) -> Array:
    """(n,) metres by which the placements that are as probable go beyond each vertex."""
    own = shape.shape.vertices.astype(np.float64)
    reach = np.zeros(len(own))
    step = -(-len(own) // config.alike_vertices)
    T_shape_cam = np.linalg.inv(shape.T_cam_shape)
    for number, T in enumerate(every_alike(shape, config)):
        # Others each time: turned a little, they come to lie between those of the time before.
        vertices = transform_points(T_shape_cam @ T, own[number % step :: step])
        closest, face = shape.shape.closest(vertices)
        out = np.linalg.norm(closest - vertices, axis=1) * shape.unit
        # Nearer than that it makes no difference on which side they lie.
        clear = np.flatnonzero(out > _CLEAR)
        out[clear[shape.shape.inside(vertices[clear])]] = 0.0
        for corner in shape.shape.faces[face].T:
            np.maximum.at(reach, corner, out)
    # Between two vertices of a placement lies what neither of them reaches.
    wider = reach.copy()
    for a, b in ((0, 1), (1, 2), (2, 0)):
        first, second = shape.shape.faces[:, a], shape.shape.faces[:, b]
        np.maximum.at(wider, first, reach[second])
        np.maximum.at(wider, second, reach[first])
    return wider


def marching_cubes_of(inside: NDArray[np.floating], axes: Axes) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 3), metres, and faces (m, 3) of the closed, outward surface of {inside > 0},
    where `inside` (nx, ny, nz) is given at the nodes of a grid."""
    from skimage.measure import marching_cubes

    spacing = float(axes[0][1] - axes[0][0])
    # A node on the surface itself is a surface without volume, or none at all.
    least = 1e-3 * spacing
    volume = np.where(np.abs(inside) < least, least, inside)
    volume = np.pad(volume, 1, constant_values=-spacing)
    vertices, faces, _, _ = marching_cubes(volume, 0.0, gradient_direction="ascent")
    origin = np.array([axis[0] for axis in axes])
    return (vertices.astype(np.float64) - 1) * spacing + origin, faces.astype(np.int64)
