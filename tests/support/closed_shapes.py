"""Solids as a prior stores them, and where a hypothesis puts them."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from brrp_cli.geometry import similarity
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.prior.build.coloured_mesh import unpainted
from brrp_cli.prior.build.stored_shape import stored_shape
from brrp_cli.prior.parameters import FieldConfig, MeshConfig
from brrp_cli.prior.shape import StoredShape
from brrp_cli.shapes import solids

FIELD = FieldConfig(nodes=4_000)
EDGES = MeshConfig(edge=0.2)
# Metres: height of the beaker's middle and of its rim, its inner and outer radius.
CUP_HEIGHT, CUP_RADIUS, CUP_WALL = 0.08, 0.035, 0.0015


def cup() -> trimesh.Trimesh:
    """A beaker whose wall is 1.5 mm thick, with its foot on z = 0."""
    return solids.beaker(CUP_RADIUS, CUP_RADIUS, CUP_HEIGHT, CUP_WALL)


def stored(mesh: trimesh.Trimesh, field: FieldConfig = FIELD) -> tuple[StoredShape, NDArray]:
    """A mesh in metres as the prior keeps it, and T_mesh_shape (4, 4)."""
    middle, half_extent = mesh.bounds.mean(axis=0), mesh.extents.max() / 2
    normalised = mesh.copy()
    normalised.apply_translation(-middle)
    normalised.apply_scale(1 / half_extent)
    shape = stored_shape(normalised, unpainted(normalised), np.eye(4), field, EDGES)
    return shape, similarity(half_extent, translation=middle)


def at(
    mesh: trimesh.Trimesh,
    T_cam_mesh: NDArray | None = None,
    *,
    name: str = "thing",
    width: float = 0.001,
    limit: float = 5.0,
    field: FieldConfig = FIELD,
) -> PlacedShape:
    """The hypothesis that a mesh, in metres, stands there."""
    shape, T_mesh_shape = stored(mesh, field)
    T = np.eye(4) if T_cam_mesh is None else T_cam_mesh
    return PlacedShape(name, shape, T @ T_mesh_shape, width, limit)
