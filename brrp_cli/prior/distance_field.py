"""Signed distance to a closed surface, kept on a lattice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.prior.parameters import FieldConfig

if TYPE_CHECKING:
    import trimesh

# Three rays a node: one that grazes an edge is outvoted.
RAYS = 3


@dataclass(frozen=True)
class DistanceField:
    """Distances at the nodes lower + spacing * (i, j, k), negative inside, in the unit and frame of
    the mesh that it was made of.

    lower : (3,) float64; spacing : > 0; values : (nx, ny, nz) float32
    """

    lower: NDArray[np.float64]
    spacing: float
    values: NDArray[np.float32]

    def signed_distance(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Distance (n,) at points (n, 3): trilinear; off the lattice, that of its nearest point
        and the way there."""
        from scipy.ndimage import map_coordinates

        at = (np.asarray(points, dtype=np.float64) - self.lower) / self.spacing
        within = np.clip(at, 0, np.array(self.values.shape) - 1)
        beyond = np.linalg.norm(at - within, axis=-1) * self.spacing
        inside = map_coordinates(self.values, within.T, order=1, mode="nearest", output=np.float64)
        return np.asarray(inside + beyond)


def distance_field(mesh: trimesh.Trimesh, config: FieldConfig) -> DistanceField:
    """The field of a closed mesh on about `config.nodes` nodes, which reach `config.margin` beyond
    its bounding box. The longer the box, the coarser: a flat object gets a fine lattice."""
    o3d = import_open3d()
    low, high = mesh.bounds[0] - config.margin, mesh.bounds[1] + config.margin
    spacing = float((np.prod(high - low) / config.nodes) ** (1 / 3))
    shape = np.ceil((high - low) / spacing).astype(np.int64) + 1
    lower = (low + high) / 2 - (shape - 1) * spacing / 2
    axes = [start + spacing * np.arange(n) for start, n in zip(lower, shape, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor(np.asarray(mesh.vertices, dtype=np.float32)),
        o3d.core.Tensor(np.asarray(mesh.faces, dtype=np.uint32)),
    )
    query = o3d.core.Tensor(np.ascontiguousarray(nodes, dtype=np.float32))
    distance = scene.compute_distance(query, nthreads=1).numpy()
    inside = scene.compute_occupancy(query, nthreads=1, nsamples=RAYS).numpy() > 0.5
    values = np.where(inside, -distance, distance).reshape(tuple(shape))
    # As the shard keeps it, so that what was just made is what will be read.
    return DistanceField(lower, spacing, values.astype(np.float16).astype(np.float32))
