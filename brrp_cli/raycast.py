"""Ray casting with Open3D (Embree): what a camera sees, what lies inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
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


def raycasting_scene(meshes: Sequence[trimesh.Trimesh], threads: int = 0) -> Any:
    """An Open3D RaycastingScene in which mesh i has geometry id i. threads : 0 = all cores."""
    return _scene_of([(mesh.vertices, mesh.faces) for mesh in meshes], threads)


def surface_scene(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], threads: int = 1
) -> Any:
    """An Open3D RaycastingScene of one surface: vertices (n, 3), faces (m, 3). threads : 0 = all
    cores."""
    return _scene_of([(vertices, faces)], threads)


def _scene_of(
    surfaces: Sequence[tuple[NDArray[np.floating], NDArray[np.integer]]], threads: int
) -> Any:
    o3d = import_open3d()
    scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
    for vertices, faces in surfaces:
        scene.add_triangles(
            o3d.core.Tensor(np.array(vertices, dtype=np.float32)),
            o3d.core.Tensor(np.array(faces, dtype=np.uint32)),
        )
    return scene


@dataclass(frozen=True)
class Sight:
    """What a pinhole camera sees of meshes in its own frame, pixel by pixel.

    depth : (H, W) float32, metres along z, 0 where nothing is hit
    index : (H, W) int64, which mesh, -1 where nothing is hit
    normals : (H, W, 3) float32, unit, of the face that is hit, camera frame
    """

    depth: NDArray[np.float32]
    index: NDArray[np.int64]
    normals: NDArray[np.float32]


def look(
    meshes: Sequence[trimesh.Trimesh], K: NDArray[np.floating], shape: tuple[int, int]
) -> Sight:
    """Cast one ray through each pixel centre of an image of `shape` (H, W).

    meshes : in the camera frame (x right, y down, z forward), metres; K : (3, 3), pixels.
    """
    o3d = import_open3d()
    height, width = shape
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    rays = np.zeros((height, width, 6), dtype=np.float32)
    # With z = 1 in the direction, the distance along the ray is the depth itself.
    rays[..., 3] = (u - K[0, 2]) / K[0, 0]
    rays[..., 4] = (v - K[1, 2]) / K[1, 1]
    rays[..., 5] = 1.0
    hits = raycasting_scene(meshes).cast_rays(o3d.core.Tensor(rays))
    depth = hits["t_hit"].numpy()
    hit = np.isfinite(depth)
    return Sight(
        depth=np.where(hit, depth, 0.0).astype(np.float32),
        index=np.where(hit, hits["geometry_ids"].numpy().astype(np.int64), -1),
        normals=hits["primitive_normals"].numpy(),
    )


def inside(mesh: trimesh.Trimesh, points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which of `points` (n, 3), in the mesh's frame, lie inside a closed mesh: (n,) bool.

    Errors: MeshError for a mesh that is not closed, where the question has no answer.
    """
    return Solid(mesh).inside(points)


class Solid:
    """A closed mesh that is asked more than once. Errors: MeshError for one that is not closed."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        if len(mesh.faces) == 0 or not mesh.is_watertight:
            raise MeshError(
                "Inside and outside of an open mesh are not defined",
                expected="a closed surface",
                found=f"{len(mesh.faces)} faces, not closed",
                fix="repair the mesh first",
            )
        self.mesh = mesh
        self.bounds = np.asarray(mesh.bounds)

    @cached_property
    def _scene(self) -> Any:
        # Rays are float32: far from the origin they would lose millimetres.
        centred = self.mesh.copy()
        centred.apply_translation(-self.bounds.mean(axis=0))
        return raycasting_scene([centred])

    def inside(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Which of `points` (n, 3), in the mesh's frame, lie inside: (n,) bool."""
        low, high = self.bounds
        found = ((points >= low) & (points <= high)).all(axis=-1)
        if not found.any():
            return np.asarray(found)
        o3d = import_open3d()
        near = points[found] - self.bounds.mean(axis=0)
        query = o3d.core.Tensor(np.ascontiguousarray(near, dtype=np.float32))
        found[found] = self._scene.compute_occupancy(query, nsamples=RAYS).numpy() > 0.5
        return np.asarray(found)
