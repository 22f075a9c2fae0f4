"""Ray casting with Open3D (Embree): what a camera sees, what lies inside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.errors import MeshError

if TYPE_CHECKING:
    import trimesh

# The majority of rays decides, since a ray through an edge may miss both of its faces. Points
# 0.05 mm inside the edge of a cube were still misjudged with 7.
RAYS = 11


def raycasting_scene(meshes: Sequence[trimesh.Trimesh]) -> Any:
    """An Open3D RaycastingScene in which mesh i has geometry id i."""
    o3d = import_open3d()
    scene = o3d.t.geometry.RaycastingScene()
    for mesh in meshes:
        scene.add_triangles(
            o3d.core.Tensor(np.array(mesh.vertices, dtype=np.float32)),
            o3d.core.Tensor(np.array(mesh.faces, dtype=np.uint32)),
        )
    return scene


def inside(mesh: trimesh.Trimesh, points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which of `points` (n, 3), in the mesh's frame, lie inside a closed mesh: (n,) bool.

    Errors: MeshError for a mesh that is not closed, where the question has no answer.
    """
    if len(mesh.faces) == 0 or not mesh.is_watertight:
        raise MeshError(
            "Inside and outside of an open mesh are not defined",
            expected="a closed surface",
            found=f"{len(mesh.faces)} faces, not closed",
            fix="repair the mesh first",
        )
    if len(points) == 0:
        return np.zeros(0, dtype=bool)
    o3d = import_open3d()
    # Rays are float32: far from the origin they would lose millimetres.
    center = mesh.bounds.mean(axis=0)
    centred = mesh.copy()
    centred.apply_translation(-center)
    query = o3d.core.Tensor(np.ascontiguousarray(points - center, dtype=np.float32))
    occupancy = raycasting_scene([centred]).compute_occupancy(query, nsamples=RAYS)
    return np.asarray(occupancy.numpy() > 0.5)
