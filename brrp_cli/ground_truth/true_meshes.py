"""The true meshes, closed: as the published tables close them, and as they are.

Closing takes seconds a mesh, so that it is done once and kept on disk by the content of the mesh.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.files import atomic_path
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
class ClosedMeshes:
    """One object's true mesh, closed in three ways, all in one frame.

    exact : repaired, neither thickened nor smoothed
    for_iou, for_chamfer : as the published tables close it, which thickens thin walls
    thickness : median over the exact mesh, metres; pieces : connected pieces of it
    """

    exact: trimesh.Trimesh
    for_iou: trimesh.Trimesh
    for_chamfer: trimesh.Trimesh
    thickness: float = math.nan
    pieces: int = 1

    def moved(self, T_target_source: np.ndarray) -> ClosedMeshes:
        """The same in another frame, by a similarity."""
        exact, for_iou, for_chamfer = (
            mesh.copy().apply_transform(T_target_source)
            for mesh in (self.exact, self.for_iou, self.for_chamfer)
        )
        scale = float(np.cbrt(np.linalg.det(T_target_source[:3, :3])))
        return ClosedMeshes(exact, for_iou, for_chamfer, self.thickness * scale, self.pieces)


def truth_cache() -> Path:
    """Where closed meshes are kept."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("brrp")) / "truth"


def close_truth(true_object: TrueObject, data_root: Path | None, cache: Path) -> ClosedMeshes:
    """The object's closed meshes in world metres.

    They are closed in the frame of their file, whose axes decide how the published way thickens.
    Errors: SceneError if the mesh is missing or does not load, MeshError if nothing closes it.
    """
    mesh = true_mesh(replace(true_object, T_world_object=np.eye(4)), data_root)
    exact = _repaired(mesh, cache)
    thickness, pieces = _measured(exact, cache)
    closed = ClosedMeshes(
        exact=exact,
        for_iou=published_truth(mesh, IOU_RESOLUTION, cache),
        for_chamfer=published_truth(mesh, CHAMFER_RESOLUTION, cache),
        thickness=thickness,
        pieces=pieces,
    )
    return closed.moved(true_object.T_world_object)


def _repaired(mesh: trimesh.Trimesh, cache: Path) -> trimesh.Trimesh:
    import trimesh

    from brrp_cli.prior.build.repair import repair

    kept = cache / f"{content_hash(mesh)}-exact.npz"
    if kept.exists():
        with np.load(kept, allow_pickle=False) as arrays:
            return trimesh.Trimesh(arrays["vertices"], arrays["faces"], process=False)
    closed = repair(mesh).mesh
    with atomic_path(kept) as partial:
        np.savez_compressed(partial, vertices=closed.vertices, faces=closed.faces)
    return closed


def _measured(exact: trimesh.Trimesh, cache: Path) -> tuple[float, int]:
    """Median thickness in metres, and connected pieces."""
    kept = cache / f"{content_hash(exact)}-thickness.npz"
    if kept.exists():
        with np.load(kept, allow_pickle=False) as arrays:
            return float(arrays["thickness"]), int(arrays["pieces"])
    thickness, pieces = median_thickness(exact), int(exact.body_count)
    with atomic_path(kept) as partial:
        np.savez(partial, thickness=thickness, pieces=pieces)
    return thickness, pieces
