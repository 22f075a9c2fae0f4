"""A wrap that is laid onto the surface around which it was made.

A wrap lies its offset outside, all around: a can of 25 cm would be 2.5 mm wider than it is. So each
of its vertices moves back, onto the nearest point of what was wrapped. Around a sheet both sides
would meet there: a wall is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.dependencies import import_open3d
from brrp_cli.raycast import raycasting_scene

if TYPE_CHECKING:
    import trimesh

# Share of the offset: a vertex that is nearer to the surface lies on it, and a ray starts so far
# below its vertex, past the faces that meet there.
PAST = 0.1


def settled(
    wrap: trimesh.Trimesh, surface: trimesh.Trimesh, offset: float, wall: float, spanning: float
) -> trimesh.Trimesh:
    """The closed mesh `wrap` with its vertices moved inward onto `surface`, by no more than leaves
    it `wall` thick. All in one frame, lengths in its unit.

    offset, spanning : as in RepairConfig, `offset` in the unit; over openings the wrap sinks by it
    """
    import trimesh

    # Between its vertices a face cuts the surface's edges off.
    finer = wrap.subdivide()
    vertices, inward = np.asarray(finer.vertices), -np.asarray(finer.vertex_normals)
    way = _nearest(surface, vertices) - vertices
    length = np.linalg.norm(way, axis=1, keepdims=True)
    below = np.einsum("nc,nc->n", way, inward) >= spanning * length[:, 0]
    rims = ~below & (length[:, 0] > PAST * offset)
    way /= np.maximum(length, 1e-12)
    way[rims], length[rims] = inward[rims], offset
    room = (_thickness(wrap, vertices, way, PAST * offset) - wall) / 2
    moved = vertices + way * np.clip(length[:, 0], 0.0, np.maximum(room, 0.0))[:, None]
    return trimesh.Trimesh(moved, finer.faces, process=False)


def _nearest(surface: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """The nearest points (n, 3) of the surface."""
    query = import_open3d().core.Tensor(points.astype(np.float32))
    scene = raycasting_scene([surface], threads=1)
    found = scene.compute_closest_points(query, nthreads=1)["points"].numpy()
    return np.asarray(found, dtype=np.float64)


def _thickness(
    closed: trimesh.Trimesh, vertices: np.ndarray, way: np.ndarray, past: float
) -> np.ndarray:
    """(n,) how far the other side of a closed mesh is from its vertices (n, 3), along unit vectors
    (n, 3)."""
    rays = np.concatenate([vertices + past * way, way], axis=1).astype(np.float32)
    scene = raycasting_scene([closed], threads=1)
    hits = scene.cast_rays(import_open3d().core.Tensor(rays), nthreads=1)["t_hit"].numpy()
    return np.asarray(hits, dtype=np.float64) + past
