"""The closed mesh of a stored object, with its colours, and signed distances that are exact where
it matters: within millimetres of the surface."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.raycast import surface_scene

# Rays that vote on which side of the surface a point lies: one that grazes an edge is outvoted.
RAYS = 3
# What a field is off by at most, in spacings: the mean of exact distances at the corners of a cell,
# weighed by how near they are, is off by sqrt(3) / 2 at most; its half precision comes on top.
OFF = 0.9


@dataclass(frozen=True, eq=False)
class StoredShape:
    """A closed, outward mesh in the unit and frame of the field that goes with it.

    vertices : (n, 3) float32; faces : (m, 3) int32
    colours : (n, 3) uint8, RGB; grey where nothing is known of them
    field : signed distances on a coarse grid, which serve far from the surface
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    colours: NDArray[np.uint8]
    field: DistanceField

    def __getstate__(self) -> dict[str, Any]:
        # What follows from the rest is made again: Open3D's scenes do not go between processes.
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @cached_property
    def scene(self) -> Any:
        """Open3D's RaycastingScene of the mesh, on one thread."""
        return surface_scene(self.vertices, self.faces)

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(n, 3) unit, outward, at the vertices: the mean of the faces around, by angle."""
        import trimesh

        mesh = trimesh.Trimesh(self.vertices, self.faces, process=False)
        return np.asarray(mesh.vertex_normals, dtype=np.float64)

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """(n,) how much further than its faces a vertex has to be moved along its normal: 1 where
        the surface is flat, 1.7 at the corner of a box, 2.5 at most."""
        import trimesh

        mesh = trimesh.Trimesh(self.vertices, self.faces, process=False)
        least = np.ones(len(self.vertices))
        for corner in mesh.faces.T:
            along = np.einsum("fi,fi->f", mesh.face_normals, self.normals[corner])
            np.minimum.at(least, corner, along)
        return 1 / np.maximum(least, 0.4)

    def met(
        self, T_cam_shape: NDArray[np.float64], rays: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What rays (..., 3) from the camera meet first of the shape where T_cam_shape (4, 4), a
        similarity, places it: how many times its own length each goes, inf where it misses, and
        the surface's unit normal (..., 3) there, camera frame."""
        o3d = import_open3d()
        T_shape_cam = np.linalg.inv(T_cam_shape)
        cast = np.empty((*rays.shape[:-1], 6), dtype=np.float32)
        cast[..., :3] = T_shape_cam[:3, 3]
        cast[..., 3:] = rays @ T_shape_cam[:3, :3].T
        hits = self.scene.cast_rays(o3d.core.Tensor(cast), nthreads=1)
        turn = T_cam_shape[:3, :3] / np.cbrt(np.linalg.det(T_cam_shape[:3, :3]))
        normals = hits["primitive_normals"].numpy().astype(np.float64) @ turn.T
        return hits["t_hit"].numpy().astype(np.float64), normals

    def signed_distance(self, points: NDArray[np.floating], band: float) -> NDArray[np.float64]:
        """Distance (n,) of points (n, 3), negative inside.

        Exact where it is less than `band`; further away, the field's, which is right to about its
        spacing.
        """
        points = np.asarray(points)
        distance = self.field.signed_distance(points)
        near = np.flatnonzero(np.abs(distance) < band + OFF * self.field.spacing)
        if len(near):
            exact, _ = self._nearest(points[near])
            # Further from the surface than the field can be off, its sign is right.
            unsure = np.abs(distance[near]) < OFF * self.field.spacing
            inside = distance[near] < 0
            inside[unsure] = self.inside(points[near[unsure]])
            distance[near] = np.where(inside, -exact, exact)
        return distance

    def distance(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Exact distance (n,) of points (n, 3) from the surface, without a sign."""
        distance = self.scene.compute_distance(_tensor(points), nthreads=1).numpy()
        return np.asarray(distance, dtype=np.float64)

    def nearest(
        self, points: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Exact distance (n,) of points (n, 3), negative inside, and the nearest face (n,)."""
        distance, face = self._nearest(points)
        return np.where(self.inside(points), -distance, distance), face

    def closest(
        self, points: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The point of the surface (n, 3) that is nearest to each of points (n, 3), and its face
        (n,)."""
        closest = self.scene.compute_closest_points(_tensor(points), nthreads=1)
        face = closest["primitive_ids"].numpy().astype(np.int64)
        return closest["points"].numpy().astype(np.float64), face

    def _nearest(
        self, points: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """`nearest` without a sign."""
        closest, face = self.closest(points)
        return np.linalg.norm(closest - points, axis=1), face

    def inside(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Which of points (n, 3) lie inside."""
        occupied = self.scene.compute_occupancy(_tensor(points), nthreads=1, nsamples=RAYS)
        return np.asarray(occupied.numpy() > 0.5)


def _tensor(points: NDArray[np.floating]) -> Any:
    """Points (n, 3) as Open3D takes them."""
    return import_open3d().core.Tensor(np.ascontiguousarray(points, dtype=np.float32))
