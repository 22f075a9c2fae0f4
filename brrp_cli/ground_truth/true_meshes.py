"""The true meshes, closed: as the published tables close them, and as they are.

Closing takes seconds a mesh, so that it is done once and kept on disk by the content of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.files import atomic_path
from brrp_cli.ground_truth.kept import read_kept
from brrp_cli.ground_truth.pieces import count_pieces
from brrp_cli.ground_truth.thickness import median_thickness
from brrp_cli.ground_truth.truth import TrueObject, true_mesh
from brrp_cli.ground_truth.watertight import (
    CHAMFER_RESOLUTION,
    IOU_RESOLUTION,
    content_hash,
    published_truth,
)

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class ExactMesh:
    """One object's true mesh, repaired, neither thickened nor smoothed, metres.

    thickness : median, metres; pieces : connected pieces
    """

    mesh: trimesh.Trimesh
    thickness: float
    pieces: int

    def moved(self, T_target_source: np.ndarray) -> ExactMesh:
        """The same in another frame, by a similarity."""
        scale = float(np.cbrt(np.linalg.det(T_target_source[:3, :3])))
        mesh = self.mesh.copy().apply_transform(T_target_source)
        return ExactMesh(mesh, self.thickness * scale, self.pieces)


@dataclass(frozen=True)
class ClosedMeshes:
    """One object's true mesh, closed in three ways, all in one frame.

    exact : repaired, neither thickened nor smoothed; measured : the same, with its thickness
    for_iou, for_chamfer : as the published tables close it, which thickens thin walls
    """

    measured: ExactMesh
    for_iou: trimesh.Trimesh
    for_chamfer: trimesh.Trimesh

    @property
    def exact(self) -> trimesh.Trimesh:
        """The mesh of `measured`."""
        return self.measured.mesh

    def moved(self, T_target_source: np.ndarray) -> ClosedMeshes:
        """The same in another frame, by a similarity."""
        return ClosedMeshes(
            self.measured.moved(T_target_source),
            self.for_iou.copy().apply_transform(T_target_source),
            self.for_chamfer.copy().apply_transform(T_target_source),
        )


def truth_cache() -> Path:
    """Where closed meshes are kept."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("brrp")) / "truth"


def close_truth(true_object: TrueObject, data_root: Path | None, cache: Path) -> ClosedMeshes:
    """The object's closed meshes in world metres.

    They are closed in the frame of their file, whose axes decide how the published way thickens.
    Errors: SceneError if the mesh is missing or does not load, or if what was kept is damaged;
    MeshError if nothing closes it.
    """
    mesh = _in_its_own_frame(true_object, data_root)
    closed = ClosedMeshes(
        measured=_measured(_repaired(mesh, cache), cache),
        for_iou=published_truth(mesh, IOU_RESOLUTION, cache),
        for_chamfer=published_truth(mesh, CHAMFER_RESOLUTION, cache),
    )
    return closed.moved(true_object.T_world_object)


def exact_truth(true_object: TrueObject, data_root: Path | None, cache: Path) -> ExactMesh:
    """The object's exact mesh in world metres. Errors: as `close_truth`."""
    mesh = _in_its_own_frame(true_object, data_root)
    return _measured(_repaired(mesh, cache), cache).moved(true_object.T_world_object)


def _in_its_own_frame(true_object: TrueObject, data_root: Path | None) -> trimesh.Trimesh:
    mesh: trimesh.Trimesh = true_mesh(replace(true_object, T_world_object=np.eye(4)), data_root)
    return mesh


def _repaired(mesh: trimesh.Trimesh, cache: Path) -> trimesh.Trimesh:
    import trimesh

    from brrp_cli.prior.build.repair import repair

    kept = cache / f"{content_hash(mesh)}-settled.npz"
    if kept.exists():
        vertices, faces = read_kept(kept, "vertices", "faces")
        return trimesh.Trimesh(vertices, faces, process=False)
    closed = repair(mesh).mesh
    with atomic_path(kept) as partial:
        np.savez_compressed(partial, vertices=closed.vertices, faces=closed.faces)
    return closed


def _measured(mesh: trimesh.Trimesh, cache: Path) -> ExactMesh:
    kept = cache / f"{content_hash(mesh)}-thickness.npz"
    if kept.exists():
        thickness, pieces = read_kept(kept, "thickness", "pieces")
        return ExactMesh(mesh, float(thickness), int(pieces))
    found = ExactMesh(mesh, median_thickness(mesh), count_pieces(mesh))
    with atomic_path(kept) as partial:
        np.savez(partial, thickness=found.thickness, pieces=found.pieces)
    return found
