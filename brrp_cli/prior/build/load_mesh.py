"""Load a mesh file and refuse what cannot become an object."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.errors import MeshError
from brrp_cli.files import trouble_of
from brrp_cli.prior.parameters import UNITS

if TYPE_CHECKING:
    import trimesh

MAX_EXTENT = 10.0
MIN_EXTENT = 1e-4


def load_mesh(path: Path, units: str = "m") -> trimesh.Trimesh:
    """The file's triangles in metres, mesh frame, texture seams merged; no textures.

    Scenes (GLB) become one mesh in the scene's frame. Errors: MeshError for what cannot be read,
    is empty, has vertices that are no numbers, or an extent over 10 m or under 0.1 mm.
    """
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False, maintain_order=True, skip_materials=True)
        loaded = scene.to_mesh() if scene.geometry else trimesh.Trimesh()
    except Exception as error:
        # trimesh's readers raise whatever the damaged file made them stumble over.
        known = isinstance(error, (OSError, ImportError, MemoryError))
        raise MeshError(
            "The mesh file cannot be read",
            where=path,
            expected=f"a whole {path.suffix[1:].upper()} file",
            found=trouble_of(error) if known else "bytes that are no such mesh",
            fix="it is damaged, cut short or not what its name says: export it again",
        ) from error
    vertices = np.asarray(loaded.vertices, dtype=np.float64)
    faces = np.asarray(loaded.faces, dtype=np.int64)
    if len(faces) == 0:
        raise MeshError("The mesh has no faces", where=path, found=f"{len(vertices)} vertices")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise MeshError(
            "A face points at a vertex that is not there",
            where=path,
            expected=f"0 to {len(vertices) - 1}",
            found=f"{faces.min()} to {faces.max()}",
        )
    if not np.isfinite(vertices[faces]).all():
        raise MeshError("The mesh has vertices that are NaN or infinite", where=path)
    mesh = trimesh.Trimesh(vertices * UNITS[units], faces, process=False)
    mesh.remove_unreferenced_vertices()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    _check_size(mesh.extents, path, units)
    _check_thickness(mesh, path)
    return mesh


def _check_size(extents: np.ndarray, path: Path, units: str) -> None:
    size = " x ".join(f"{extent:.4g}" for extent in extents) + " m"
    if extents.max() > MAX_EXTENT:
        raise MeshError(
            "The mesh is too large for a tabletop object",
            where=path,
            expected=f"at most {MAX_EXTENT:g} m in every direction",
            found=f"{size}, read with --units {units}",
            fix="if the file is in millimetres, pass --units mm (or cm)",
        )
    if extents.max() < MIN_EXTENT:
        raise MeshError(
            "The mesh is too small to be an object",
            where=path,
            expected=f"at least {MIN_EXTENT:g} m in one direction",
            found=f"{size}, read with --units {units}",
            fix="export it larger" if units == "m" else "if the file is in metres, pass --units m",
        )


def _check_thickness(mesh: trimesh.Trimesh, path: Path) -> None:
    spread = np.linalg.svd(mesh.vertices - mesh.vertices.mean(axis=0), compute_uv=False)
    if len(spread) < 3 or spread[2] < 1e-6 * spread[0]:
        raise MeshError(
            "The mesh is flat: it has no inside",
            where=path,
            found=f"{len(mesh.vertices)} vertices in one plane",
        )
