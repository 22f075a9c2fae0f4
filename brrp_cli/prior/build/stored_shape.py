"""The mesh that a prior keeps of an object: closed, fine enough to be bent a little, coloured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.prior.build.coloured_mesh import PaintedMesh
from brrp_cli.prior.build.vertex_colours import vertex_colours
from brrp_cli.prior.distance_field import distance_field
from brrp_cli.prior.parameters import FieldConfig, MeshConfig
from brrp_cli.prior.shape import StoredShape

if TYPE_CHECKING:
    import trimesh


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
        vertex_colours(painted, in_painted, faces, config.colours),
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
