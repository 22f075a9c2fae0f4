"""The mesh that a prior keeps of an object: closed, fine enough to be bent a little, coloured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.prior.build.coloured_mesh import PaintedMesh
from brrp_cli.prior.distance_field import distance_field
from brrp_cli.prior.parameters import FieldConfig, MeshConfig
from brrp_cli.prior.shape import StoredShape
from brrp_cli.raycast import raycasting_scene

if TYPE_CHECKING:
    import trimesh

GREY = 150


def stored_shape(
    mesh: trimesh.Trimesh,
    painted: PaintedMesh,
    T_mesh_painted: NDArray[np.float64],
    distances: FieldConfig,
    config: MeshConfig,
) -> StoredShape:
    """A closed mesh as the prior keeps it.

    painted : the same object with its colours; T_mesh_painted : (4, 4) similarity, from its frame
    to that of the mesh
    """
    vertices, faces = subdivided(np.asarray(mesh.vertices), np.asarray(mesh.faces), config)
    # As the shard keeps it, so that what was just made is what will be read.
    kept: NDArray[np.float32] = vertices.astype(np.float32)
    T_painted_mesh = np.linalg.inv(T_mesh_painted)
    in_painted = kept @ T_painted_mesh[:3, :3].T + T_painted_mesh[:3, 3]
    return StoredShape(
        kept,
        faces.astype(np.int32),
        colours_at(painted, in_painted),
        distance_field(mesh, distances),
    )


def subdivided(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], config: MeshConfig
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Every face in four, as often as it takes until no edge is longer than `config.edge` of the
    largest half-extent, or another time would make more than `config.faces` faces. The surface
    stays the same to the last point, and closed."""
    from trimesh.remesh import subdivide

    longest = config.edge * np.ptp(vertices, axis=0).max() / 2
    while 4 * len(faces) <= config.faces and _longest_edge(vertices, faces) > longest:
        vertices, faces = subdivide(vertices, faces)[:2]
    return vertices, faces


def _longest_edge(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> float:
    corners = vertices[faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max())


def colours_at(painted: PaintedMesh, points: NDArray[np.floating]) -> NDArray[np.uint8]:
    """RGB (n, 3) at the nearest points of a coloured mesh to points (n, 3) in its frame; grey where
    it has no colour."""
    o3d = import_open3d()
    parts = [part.copy() for part, _ in painted.parts]
    # Rays and distances are float32: far from the origin they lose the shape.
    center = painted.vertices.mean(axis=0)
    for part in parts:
        part.apply_translation(-center)
    query = o3d.core.Tensor(np.ascontiguousarray(points - center, dtype=np.float32))
    found = raycasting_scene(parts).compute_closest_points(query)
    part_of = found["geometry_ids"].numpy().astype(np.int64)
    face = found["primitive_ids"].numpy().astype(np.int64)
    uv = found["primitive_uvs"].numpy()
    weights = np.column_stack([1 - uv.sum(axis=1), uv])
    rgb = np.full((len(points), 3), np.nan, np.float32)
    for index, (_, paint) in enumerate(painted.parts):
        here = part_of == index
        rgb[here] = paint.at(face[here], weights[here])
    return np.nan_to_num(rgb, nan=GREY).round().clip(0, 255).astype(np.uint8)
