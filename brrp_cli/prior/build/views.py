"""What is seen of a mesh from all around: points, normals and colours, by parallel rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.prior.build.coloured_mesh import PaintedMesh
from brrp_cli.raycast import raycasting_scene


@dataclass(frozen=True)
class SeenSide:
    """One view. points (k, 3) metres, about the middle of the mesh's box, along the mesh's axes;
    normals (k, 3) unit, towards the viewer; rgb (k, 3) 0 to 255, NaN where there is no colour."""

    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    rgb: NDArray[np.float32]


def directions(count: int) -> NDArray[np.float64]:
    """(count, 3) unit vectors spread evenly over the sphere, on Fibonacci's spiral."""
    step = np.arange(count)
    z = 1 - (2 * step + 1) / count
    angle = step * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - z**2)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=-1)


def views_around(mesh: PaintedMesh, count: int, rays: int) -> list[SeenSide]:
    """The mesh from `count` directions, with about `rays` parallel rays through its silhouette's
    box.

    The same mesh gives the same sides: nothing is drawn at random.
    """
    vertices = mesh.vertices
    center = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    # Rays are float32, which has no digits left for the shape far from the origin.
    parts = [part.copy() for part, _ in mesh.parts]
    for part in parts:
        part.apply_translation(-center)
    scene = raycasting_scene(parts)
    return [_look(mesh, scene, vertices - center, way, rays) for way in directions(count)]


def _look(
    mesh: PaintedMesh,
    scene: Any,
    vertices: NDArray[np.float64],
    toward: NDArray[np.float64],
    rays: int,
) -> SeenSide:
    o3d = import_open3d()
    right = np.linalg.svd(toward[None])[2][1]
    basis = np.stack([right, np.cross(toward, right), toward])
    local = vertices @ basis.T
    low, high = local.min(axis=0), local.max(axis=0)
    pitch = np.sqrt(max(np.prod(high[:2] - low[:2]), 1e-12) / rays)
    axes = [np.arange(a + pitch / 2, b, pitch) for a, b in zip(low[:2], high[:2], strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    away = high[2] + 0.01
    origins = np.column_stack([grid, np.full(len(grid), away)]) @ basis
    cast = np.concatenate([origins, np.broadcast_to(-toward, origins.shape)], axis=-1)
    hits = scene.cast_rays(o3d.core.Tensor(cast.astype(np.float32)))
    distance = hits["t_hit"].numpy()
    hit = np.isfinite(distance)
    part = hits["geometry_ids"].numpy()[hit].astype(np.int64)
    face = hits["primitive_ids"].numpy()[hit].astype(np.int64)
    bary = hits["primitive_uvs"].numpy()[hit]
    weights = np.column_stack([1 - bary.sum(axis=1), bary])
    rgb = np.full((len(face), 3), np.nan, np.float32)
    for index, (_, paint) in enumerate(mesh.parts):
        here = part == index
        rgb[here] = paint.at(face[here], weights[here])
    normals = hits["primitive_normals"].numpy()[hit]
    # Sheets are seen from both of their sides.
    normals = np.where(normals @ toward[:, None] < 0, -normals, normals)
    points = origins[hit] - distance[hit, None] * toward
    return SeenSide(points.astype(np.float32), normals.astype(np.float32), rgb)
