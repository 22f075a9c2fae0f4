"""A wrap that is laid onto the surface around which it was made.

A wrap lies its offset outside, all around: a can of 25 cm would be 2.5 mm wider than it is. So each
of its vertices moves back, onto the nearest point of what was wrapped. Around a sheet both sides
would meet there: a wall is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.dependencies import import_open3d

if TYPE_CHECKING:
    import trimesh

# Cosine between the way to the nearest point and the way inward. Below it the wrap spans an
# opening, and the nearest point is its rim.
BELOW = 0.5
# Share of the offset: a vertex that is nearer to the surface lies on it, and a ray starts so far
# below its vertex, past the faces that meet there.
PAST = 0.1


def settled(
    wrap: trimesh.Trimesh, surface: trimesh.Trimesh, offset: float, wall: float
) -> trimesh.Trimesh:
    """The closed mesh `wrap` with its vertices moved inward onto `surface`, by no more than leaves
    it `wall` thick. Over openings it sinks by `offset`. All in one frame, lengths in its unit."""
    import trimesh

    # Between its vertices a face cuts the surface's edges off.
    finer = wrap.subdivide()
    vertices, inward = np.asarray(finer.vertices), -np.asarray(finer.vertex_normals)
    way = _nearest(surface, vertices) - vertices
    length = np.linalg.norm(way, axis=1, keepdims=True)
    below = np.einsum("nc,nc->n", way, inward) >= BELOW * length[:, 0]
    spans = ~below & (length[:, 0] > PAST * offset)
    way /= np.maximum(length, 1e-12)
    way[spans], length[spans] = inward[spans], offset
    room = (_thickness(wrap, vertices, way, PAST * offset) - wall) / 2
    moved = vertices + way * np.clip(length[:, 0], 0.0, np.maximum(room, 0.0))[:, None]
    return trimesh.Trimesh(moved, finer.faces, process=False)


def _nearest(surface: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """The nearest points (n, 3) of the surface."""
    o3d, scene = _scene(surface)
    query = o3d.core.Tensor(points.astype(np.float32))
    found = scene.compute_closest_points(query, nthreads=1)["points"].numpy()
    return np.asarray(found, dtype=np.float64)


def _thickness(
    closed: trimesh.Trimesh, vertices: np.ndarray, way: np.ndarray, past: float
) -> np.ndarray:
    """(n,) how far the other side of a closed mesh is from its vertices (n, 3), along unit vectors
    (n, 3)."""
    o3d, scene = _scene(closed)
    rays = np.concatenate([vertices + past * way, way], axis=1).astype(np.float32)
    hits = scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)["t_hit"].numpy()
    return np.asarray(hits, dtype=np.float64) + past


def _scene(mesh: trimesh.Trimesh):  # type: ignore[no-untyped-def]
    o3d = import_open3d()
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor(np.asarray(mesh.vertices, dtype=np.float32)),
        o3d.core.Tensor(np.asarray(mesh.faces, dtype=np.uint32)),
    )
    return o3d, scene
