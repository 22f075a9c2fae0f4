"""The mesh and the distances of a stored shape, stretched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from brrp_cli.config import KinConfig
from brrp_cli.geometry import similarity
from brrp_cli.kin.library import Library
from brrp_cli.kin.placement import Placements, distance_and_slopes
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.shape import StoredShape

Array = NDArray[np.float64]


def stretched(
    placements: Placements, row: int, stored: StoredShape, library: Library, config: KinConfig
) -> StoredShape:
    """The shape of placement `row`, metres, about the middle of its box, axes of its stance.

    stored : of the object that it is made of. Far from the surface, distances are right to first
    order.
    """
    stance = placements.stance[row]
    inverse = np.linalg.inv(library.to_object[stance].astype(np.float64))
    outer, faces = largest_piece(stored)
    u = (stored.vertices[outer] - library.origin[stance]) @ inverse.T
    at_rest = Placements(
        placements.stance[[row]],
        np.zeros(1, np.float32),
        np.zeros((1, 3), np.float32),
        placements.half[[row]],
        placements.taper[[row]],
    )
    vertices = at_rest.placed(u[None])[:, 0].T
    reach = np.abs(vertices).max(axis=0) + config.margin
    spacing = float((np.prod(2 * reach) / config.field_nodes) ** (1 / 3))
    shape = np.ceil(2 * reach / spacing).astype(np.int64) + 1
    lower = -(shape - 1) * spacing / 2
    axes = [start + spacing * np.arange(n) for start, n in zip(lower, shape, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distance = distance_and_slopes(at_rest, nodes.astype(np.float32), library)[0]
    # Where a field is flat its slope says nothing: no node is further away than the box is long.
    longest = 2 * float(np.linalg.norm(reach))
    values = np.clip(distance[0], -longest, longest).reshape(tuple(shape))
    return StoredShape(
        vertices.astype(np.float32),
        faces,
        stored.colours[outer],
        DistanceField(lower, spacing, values.astype(np.float32)),
    )


def largest_piece(
    stored: StoredShape,
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Rows (w,) of the vertices of the widest connected piece of a mesh, and its faces (m, 3) over
    these: an object is one piece, and what lies inside of it is not seen."""
    count = len(stored.vertices)
    edges = np.concatenate([stored.faces[:, [0, 1]], stored.faces[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(edges), bool), edges.T), shape=(count, count))
    pieces, of = connected_components(graph, directed=False)
    width = [np.ptp(stored.vertices[of == piece], axis=0).sum() for piece in range(pieces)]
    kept = of == int(np.argmax(width))
    number = np.cumsum(kept) - 1
    faces = number[stored.faces[kept[stored.faces[:, 0]]]]
    return np.flatnonzero(kept), faces.astype(np.int32)


def pose(placements: Placements, row: int) -> Array:
    """T_plane_shape (4, 4), rigid, of the shape that `stretched` gives."""
    c, s = np.cos(float(placements.turn[row])), np.sin(float(placements.turn[row]))
    return similarity(
        rotation=np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]),
        translation=placements.middle[row].astype(np.float64),
    )
