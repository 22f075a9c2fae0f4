"""Stable resting poses: how an object that is dropped on a table comes to lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.dependencies import import_open3d
from brrp_cli.prior.objects import RestingPose
from brrp_cli.prior.parameters import PoseConfig

if TYPE_CHECKING:
    import trimesh


def resting_poses(mesh: trimesh.Trimesh, config: PoseConfig) -> list[RestingPose]:
    """Resting poses of a closed mesh of even density, most probable first, at least one.

    Poses whose resting face is tilted by less than `merge_degrees` to that of a more probable one
    are counted to it: the many facets of a scanned bottom are one pose, and those of a can's side
    a dozen.
    """
    import trimesh

    hull = mesh.convex_hull
    if len(hull.faces) > config.hull_faces:
        hull = _coarser_hull(hull, config.hull_faces)
    transforms, probabilities = trimesh.poses.compute_stable_poses(
        hull, center_mass=mesh.center_mass, seed=0
    )
    # The mesh's direction that points down: the resting face's normal.
    down = -transforms[:, 2, :3]
    cosine = np.cos(np.radians(config.merge_degrees))
    left = np.ones(len(down), dtype=bool)
    poses = []
    for i in range(len(down)):
        if left[i]:
            members = left & (down @ down[i] > cosine)
            left &= ~members
            T = np.asarray(transforms[i], dtype=np.float64)
            # The hull was simplified: let the mesh itself touch the plane.
            T[2, 3] = -(np.asarray(mesh.vertices) @ T[2, :3]).min()
            poses.append(RestingPose(T, float(probabilities[members].sum())))
    poses.sort(key=lambda pose: -pose.probability)
    kept = [pose for pose in poses if pose.probability >= config.min_probability]
    return (kept or poses[:1])[: config.max_count]


def _coarser_hull(hull: trimesh.Trimesh, faces: int) -> trimesh.Trimesh:
    import trimesh

    o3d = import_open3d()
    fine = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(np.asarray(hull.vertices)),
        o3d.utility.Vector3iVector(np.asarray(hull.faces, dtype=np.int32)),
    )
    coarse = fine.simplify_quadric_decimation(target_number_of_triangles=faces)
    return trimesh.convex.convex_hull(np.asarray(coarse.vertices))
