"""Repair a mesh to a closed, outward surface, and tell how far that lies from the original.

From the mildest remedy to the strongest, each only if the one before did not suffice: trimesh
(duplicate faces, winding, holes of three or four edges), pymeshlab (edges with more than two
faces, small holes), and a wrap around what is really open. A wide opening is never covered: the
inside of a bowl that was modelled as a sheet stays free, and the sheet becomes a thin wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from brrp_cli.dependencies import import_library
from brrp_cli.errors import MeshError
from brrp_cli.prior.build.settle import settled
from brrp_cli.prior.build.solids import is_flat, is_solid, unite_bodies
from brrp_cli.prior.build.surface_distance import surface_distances
from brrp_cli.prior.parameters import RepairConfig

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Repaired:
    """A closed mesh, in the frame and unit of the original, and what was done to get it."""

    mesh: trimesh.Trimesh
    record: dict[str, Any]


def repair(original: trimesh.Trimesh, config: RepairConfig | None = None) -> Repaired:
    """A closed, outward mesh and a record of plain JSON.

    record: `closed_before`; `steps`, in words; `original_to_repaired` and `repaired_to_original`,
    each with the `mean` and `max` distance in metres. Errors: MeshError when nothing closes it.
    """
    config = config or RepairConfig()
    closed_before = is_solid(original)
    mesh = original.copy()
    steps: list[str] = []
    if not closed_before:
        for remedy in (
            _tidy,
            partial(_split_and_fill, config=config),
            partial(_wrap, config=config),
        ):
            mesh, done = remedy(mesh)
            steps += done
            if mesh.is_watertight and mesh.is_winding_consistent:
                break
    mesh, done = unite_bodies(mesh)
    steps += done
    if not is_solid(mesh):
        raise MeshError(
            "The mesh cannot be closed to a solid",
            expected="a surface that encloses a volume",
            found=f"{len(mesh.faces)} faces, volume {mesh.volume:.3g} m^3, after: "
            + ("; ".join(steps) or "no repair"),
        )
    record = {"closed_before": closed_before, "steps": steps}
    return Repaired(mesh, {**record, **surface_distances(original, mesh, same=not steps)})


def _tidy(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, list[str]]:
    steps = []
    before = len(mesh.faces)
    mesh.update_faces(_faces_that_count(mesh.faces))
    mesh.remove_unreferenced_vertices()
    # Faces in one line enclose nothing either, and pymeshlab ends the process on them.
    if not mesh.area > 0:
        raise MeshError("The mesh encloses nothing", found=f"{before} faces, all of them needles")
    if len(mesh.faces) < before:
        steps.append(f"dropped {before - len(mesh.faces)} degenerate or duplicate faces")
    if not mesh.is_winding_consistent:
        mesh.fix_normals(multibody=True)
        steps.append("made the winding consistent")
    filled = mesh.copy()
    filled.fill_holes()
    # Filling the rim of a lone triangle would only double it.
    bodies = filled.split(only_watertight=False)
    if sum(body.area for body in bodies if is_flat(body)) < filled.area / 2:
        if len(filled.faces) > len(mesh.faces):
            added = len(filled.faces) - len(mesh.faces)
            steps.append(f"filled holes of 3 or 4 edges with {added} faces")
        mesh = filled
    return mesh, steps


def _faces_that_count(faces: np.ndarray) -> np.ndarray:
    """Which faces (n, 3) to keep: those with three corners, one of each set of duplicates, and
    none of two that lie back to back, because such a flap without thickness bounds nothing. A mesh
    that is back to back all over is a sheet drawn from both sides: of this, one side is kept."""
    corners = np.sort(faces, axis=1)
    proper = (np.diff(corners, axis=1) != 0).all(axis=1)
    # The corners ascend, up to rotation, in one of the two windings.
    winding = np.where((faces < np.roll(faces, -1, axis=1)).sum(axis=1) == 2, 1, -1)
    _, group = np.unique(corners, axis=0, return_inverse=True)
    balance = np.bincount(group, weights=winding)[group]
    candidates = np.flatnonzero(proper & (winding * balance >= 0))
    _, first = np.unique(group[candidates], return_index=True)
    once = np.zeros(len(faces), dtype=bool)
    once[candidates[first]] = True
    bounding = once & (balance != 0)
    return bounding if bounding.sum() > once.sum() / 2 else once


def _split_and_fill(
    mesh: trimesh.Trimesh, config: RepairConfig
) -> tuple[trimesh.Trimesh, list[str]]:
    steps = []
    crowded = _crowded_edges(mesh)
    if crowded:
        mesh = _meshlab(mesh, ("meshing_repair_non_manifold_edges", {"method": "Split Vertices"}))
        steps.append(f"split the vertices of {crowded} edges with more than two faces")
    if _crowded_edges(mesh):
        # Where two crowded edges share a vertex, a split may leave one of them. The smallest faces
        # at it go, and the hole that they leave is filled below or wrapped.
        before = len(mesh.faces)
        mesh = _meshlab(mesh, ("meshing_repair_non_manifold_edges", {"method": "Remove Faces"}))
        steps.append(f"removed {before - len(mesh.faces)} faces at edges that no split parts")
    if mesh.is_watertight:
        return mesh, steps
    mesh = _meshlab(mesh, ("meshing_repair_non_manifold_vertices", {"vertdispratio": 0.0}))
    rims = boundary_rims(mesh)
    limit = config.small_hole * np.linalg.norm(mesh.extents)
    small = [len(rim) for rim in rims if _width(rim) <= limit]
    wide = [len(rim) for rim in rims if _width(rim) > limit]
    # pymeshlab tells holes apart by their number of edges alone.
    edges = max((n for n in small if n < min(wide, default=n + 1)), default=0)
    if edges:
        before = len(mesh.faces)
        mesh = _meshlab(
            mesh, ("meshing_close_holes", {"maxholesize": edges + 1, "selfintersection": False})
        )
        if len(mesh.faces) > before:
            steps.append(f"filled small holes with {len(mesh.faces) - before} faces")
    return mesh, steps


def _crowded_edges(mesh: trimesh.Trimesh) -> int:
    """How many edges have more than two faces."""
    return int((np.unique(mesh.edges_unique_inverse, return_counts=True)[1] > 2).sum())


def _wrap(mesh: trimesh.Trimesh, config: RepairConfig) -> tuple[trimesh.Trimesh, list[str]]:
    pymeshlab = import_library("pymeshlab")
    widest = max((_width(rim) for rim in boundary_rims(mesh)), default=0.0)
    diagonal = float(np.linalg.norm(mesh.extents))
    wrapped = _meshlab(
        mesh,
        (
            "generate_alpha_wrap",
            {
                "alpha": pymeshlab.PercentageValue(100 * config.alpha),
                "offset": pymeshlab.PercentageValue(100 * config.offset),
            },
        ),
    )
    wall = config.wall * diagonal
    step = "wrapped the surface"
    if widest > config.small_hole * diagonal:
        step += (
            f"; openings up to {widest * 1e3:.0f} mm across stay open,"
            f" sheets are walls of {wall * 1e3:.1f} mm"
        )
    laid = settled(wrapped, mesh, config.offset * diagonal, wall, config.spanning)
    return laid, [step]


def boundary_rims(mesh: trimesh.Trimesh) -> list[np.ndarray]:
    """The open rims: for each connected set of edges with one face, its vertices (n, 3)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges, counts = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    edges = edges[counts == 1]
    n = len(mesh.vertices)
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    rim_vertices = np.unique(edges)
    labels = label[rim_vertices]
    return [mesh.vertices[rim_vertices[labels == k]].copy() for k in np.unique(labels)]


def _width(rim: np.ndarray) -> float:
    return 2 * float(np.linalg.norm(rim - rim.mean(axis=0), axis=1).max())


def _meshlab(mesh: trimesh.Trimesh, step: tuple[str, dict[str, Any]]) -> trimesh.Trimesh:
    """Run one filter of pymeshlab (GPL-3; imported for meshes that need it, and only then)."""
    import trimesh

    pymeshlab = import_library("pymeshlab")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)))
    name, options = step
    try:
        getattr(meshes, name)(**options)
    except pymeshlab.PyMeshLabException as error:
        raise MeshError("The mesh cannot be repaired", found=f"{name}: {error}") from error
    result = meshes.current_mesh()
    return trimesh.Trimesh(result.vertex_matrix(), result.face_matrix(), process=False)
