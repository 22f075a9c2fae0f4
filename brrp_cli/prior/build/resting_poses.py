"""Stable resting poses: how an object that is dropped on a table comes to lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import MeshError
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
    transforms, probabilities = _stable_poses(mesh, config)
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


def _stable_poses(
    mesh: trimesh.Trimesh, config: PoseConfig
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """T_plane_object (n, 4, 4) of the faces of the hull that the mesh rests on, and their
    probabilities (n,).

    trimesh sums solid angles of faces, which are NaN for slivers; whatever rolls over one is lost.
    So the hull loses what bends by less than a tolerance, which grows until nothing is lost.
    """
    import manifold3d
    import trimesh

    hull = manifold3d.Manifold.hull_points(np.asarray(mesh.vertices))
    best, most = (np.empty((0, 4, 4)), np.empty(0)), 0.0
    tolerance = config.tolerance
    # No hull is left where the tolerance is the size of the mesh.
    while tolerance < 1 and most < config.complete:
        simpler = hull.simplify(mesh.scale * tolerance)
        tolerance *= config.growth
        if simpler.is_empty() or simpler.num_tri() > config.hull_faces:
            continue
        corners = simpler.to_mesh64().vert_properties[:, :3]
        with np.errstate(invalid="ignore"):
            found = trimesh.poses.compute_stable_poses(
                trimesh.convex.convex_hull(corners), center_mass=mesh.center_mass, seed=0
            )
        if (total := float(found[1].sum())) > most:
            best, most = found, total
    if not most:
        raise MeshError("The mesh rests on no face of its hull", found=f"{len(mesh.faces)} faces")
    return best
