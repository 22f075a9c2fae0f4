"""Signed distance to a closed surface, kept on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.geometry import grid_nodes
from brrp_cli.prior.parameters import FieldConfig
from brrp_cli.raycast import surface_scene

if TYPE_CHECKING:
    import trimesh

# Three rays a node: one that grazes an edge is outvoted.
RAYS = 3
# Of a field that is made quickly: how many nodes from the surface it is exact, how wide a face may
# be, in nodes, and how often neighbours are asked for a nearer point of the surface.
BAND = 2
WIDEST = 3.0
ROUNDS = 3
# Of the node in the middle of three along each axis; itself first.
_NEIGHBOURS = ((1, 1, 1), (0, 1, 1), (2, 1, 1), (1, 0, 1), (1, 2, 1), (1, 1, 0), (1, 1, 2))


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
        """Distance (n,) at points (n, 3): trilinear; off the grid, that of its nearest point
        and the way there."""
        from scipy.ndimage import map_coordinates

        # The axis comes first: long contiguous rows are what NumPy is fast on.
        at = (np.asarray(points, dtype=np.float64).T - self.lower[:, None]) / self.spacing
        at = np.ascontiguousarray(at)
        distance = map_coordinates(self.values, at, order=1, mode="nearest", output=np.float64)
        off = at - at.clip(0, np.array(self.values.shape)[:, None] - 1)
        beyond = np.flatnonzero(off.any(axis=0))
        distance[beyond] += np.linalg.norm(off[:, beyond], axis=0) * self.spacing
        return np.asarray(distance)

    def distance(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """`signed_distance` (n,) at points (3, n), in single precision."""
        # Late, as Open3D is: what only lists a prior does not wait for a compiler.
        from brrp_cli.distance_loops import distances

        return distances(self.values, self.lower, self.spacing, points)

    def distance_and_gradient(
        self, points: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Distance (n,) at points (3, n), as `signed_distance` has it, and its gradient (3, n)."""
        from brrp_cli.distance_loops import distances_and_gradients

        return distances_and_gradients(self.values, self.lower, self.spacing, points)


def distance_field(mesh: trimesh.Trimesh, config: FieldConfig) -> DistanceField:
    """The field of a closed mesh on about `config.nodes` nodes, which reach `config.margin` beyond
    its bounding box. The longer the box, the coarser: a flat object gets a fine grid."""
    lower, spacing, nodes = _nodes(np.asarray(mesh.bounds), config)
    scene = surface_scene(mesh.vertices, mesh.faces)
    query = import_open3d().core.Tensor(nodes.reshape(-1, 3))
    distance = scene.compute_distance(query, nthreads=1).numpy()
    inside = scene.compute_occupancy(query, nthreads=1, nsamples=RAYS).numpy() > 0.5
    values = np.where(inside, -distance, distance).reshape(nodes.shape[:3])
    return DistanceField(lower, spacing, _as_kept(values))


def quick_distance_field(mesh: trimesh.Trimesh, config: FieldConfig) -> DistanceField:
    """`distance_field`, in a third of the time: the same within two nodes of the surface, and a
    little too long beyond, on average by a few thousandths of the distance.

    Exact are nodes that lie within two of a vertex or of the middle of a face; all others take the
    nearest of the points of the surface that belong to the exact ones around. A mesh with faces
    wider than three nodes gets the exact field.
    """
    lower, spacing, nodes = _nodes(np.asarray(mesh.bounds), config)
    corners = np.asarray(mesh.vertices)[mesh.faces]
    widest = np.square(corners - np.roll(corners, 1, axis=1)).sum(axis=2).max()
    if widest > (WIDEST * spacing) ** 2:
        return distance_field(mesh, config)
    from scipy.ndimage import distance_transform_edt, maximum_filter

    shape = nodes.shape[:3]
    exact = np.zeros(shape, np.bool_)
    on_surface = np.concatenate([np.asarray(mesh.vertices), corners.mean(axis=1)])
    exact[tuple(np.rint((on_surface - lower) / spacing).astype(np.int64).T)] = True
    exact = maximum_filter(exact, 2 * BAND + 1)
    scene = surface_scene(mesh.vertices, mesh.faces)
    query = import_open3d().core.Tensor(nodes[exact])
    closest = np.zeros_like(nodes)
    closest[exact] = scene.compute_closest_points(query, nthreads=1)["points"].numpy()
    inside = np.zeros(shape, np.bool_)
    inside[exact] = scene.compute_occupancy(query, nthreads=1, nsamples=RAYS).numpy() > 0.5

    nearest = distance_transform_edt(~exact, return_distances=False, return_indices=True)
    number = np.ravel_multi_index(tuple(nearest), shape)
    # Between a node and the nearest exact one there is no surface.
    inside = inside.ravel()[number]
    number = _nearest_around(number, ~exact, nodes, closest.reshape(-1, 3))
    distance = np.linalg.norm(nodes - closest.reshape(-1, 3)[number], axis=3)
    return DistanceField(lower, spacing, _as_kept(np.where(inside, -distance, distance)))


def _nearest_around(
    number: NDArray[np.int64],
    asked: NDArray[np.bool_],
    nodes: NDArray[np.float32],
    closest: NDArray[np.float32],
) -> NDArray[np.int64]:
    """Which of the points `closest` (m, 3) each node takes: `number` (nx, ny, nz), and at the nodes
    that are `asked` the nearest of its own and of those of its neighbours, `ROUNDS` times."""
    rows = np.flatnonzero(asked)
    at = nodes.reshape(-1, 3)[rows]
    number = number.copy()
    for _ in range(ROUNDS):
        around = np.pad(number, 1, mode="edge")
        best, square = number.ravel()[rows], np.full(len(rows), np.inf, np.float32)
        for x, y, z in _NEIGHBOURS:
            nx, ny, nz = number.shape
            one = around[x : x + nx, y : y + ny, z : z + nz].ravel()[rows]
            apart = at - closest.take(one, axis=0)
            length = np.einsum("ni,ni->n", apart, apart)
            best = np.where(length < square, one, best)
            square = np.minimum(square, length)
        number.ravel()[rows] = best
    return number


def _nodes(
    bounds: NDArray[np.float64], config: FieldConfig
) -> tuple[NDArray[np.float64], float, NDArray[np.float32]]:
    """The first node (3,), the spacing and all nodes (nx, ny, nz, 3) over a box (2, 3)."""
    low, high = bounds[0] - config.margin, bounds[1] + config.margin
    spacing = float((np.prod(high - low) / config.nodes) ** (1 / 3))
    shape = np.ceil((high - low) / spacing).astype(np.int64) + 1
    lower = (low + high) / 2 - (shape - 1) * spacing / 2
    axes = [start + spacing * np.arange(n) for start, n in zip(lower, shape, strict=True)]
    return lower, spacing, np.ascontiguousarray(grid_nodes(axes), dtype=np.float32)


def _as_kept(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """As the shard keeps it, so that what was just made is what will be read."""
    return values.astype(np.float16).astype(np.float32)
