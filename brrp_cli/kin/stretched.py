"""A fit of one stored shape as a shape of its own: its mesh, bent and stretched, and distances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from brrp_cli.config import KinConfig
from brrp_cli.geometry import similarity, turn_about_z
from brrp_cli.kin.bend import TERMS
from brrp_cli.kin.bending import BentFit, BoxPoints, bent
from brrp_cli.kin.evidence import Evidence
from brrp_cli.kin.library import Library
from brrp_cli.kin.placement import KinPlacements
from brrp_cli.kin.ways_out import seen_through
from brrp_cli.prior.distance_field import quick_distance_field
from brrp_cli.prior.parameters import FieldConfig
from brrp_cli.prior.shape import StoredShape

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BentShape:
    """A fit bent onto what was seen, and what speaks against it; u : (n, 3) vertices of the stored
    shape in its box; faces : (m, 3); colours : (n, 3); through : share of its surface that stands
    before what was measured behind it"""

    fit: BentFit
    cost: float
    u: Array
    faces: NDArray[np.int32]
    colours: NDArray[np.uint8]
    through: float = 0.0

    @property
    def T_plane_shape(self) -> Array:
        """(4, 4) rigid, from the middle of the shape's box."""
        return similarity(rotation=turn_about_z(self.fit.turn), translation=self.fit.middle)

    def shape(self, config: KinConfig) -> StoredShape:
        """Metres, about the middle of its box."""
        import trimesh

        T = self.T_plane_shape
        vertices = (self.fit.placed(BoxPoints(self.u)) - T[:3, 3]) @ T[:3, :3]
        mesh = trimesh.Trimesh(vertices, self.faces, process=False)
        field = quick_distance_field(mesh, FieldConfig(config.field_nodes, config.margin))
        return StoredShape(vertices.astype(np.float32), self.faces, self.colours, field)


def unbent_shape(
    placements: KinPlacements, row: int, stored: StoredShape, library: Library
) -> BentShape:
    """Placement `row` as it is; stored : the shape of the object that it is of."""
    stance = placements.stance[row]
    inverse = np.linalg.inv(library.to_object[stance].astype(np.float64))
    outer, faces = largest_piece(stored)
    fit = BentFit(
        library.half[stance].astype(np.float64),
        float(placements.turn[row]),
        placements.middle[row].astype(np.float64),
        placements.half[row].astype(np.float64),
        float(placements.taper[row]),
        np.zeros((3, TERMS)),
    )
    u = (stored.vertices[outer] - library.origin[stance]) @ inverse.T
    return BentShape(fit, np.inf, u, faces, stored.colours[outer])


def bent_shape(
    shape: BentShape, evidence: Evidence, config: KinConfig, rng: np.random.Generator
) -> BentShape:
    """A shape bent onto what was seen."""
    surface, normals = _sampled(shape.u, shape.faces, shape.fit.half, config.bend_points, rng)
    fit, cost = bent(shape.fit, surface, normals, evidence, config)
    through = seen_through(fit.placed(BoxPoints(surface)), evidence, config.through)
    return replace(shape, fit=fit, cost=cost, through=through)


def _sampled(
    u: Array, faces: NDArray[np.int32], half: Array, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Points (count, 3) spread evenly over the surface of a mesh whose vertices u (n, 3) lie in a
    box with half the sides `half` (3,), and the normals there; both along u."""
    import trimesh

    mesh = trimesh.Trimesh(u * half, faces, process=False)
    points, on = trimesh.sample.sample_surface(mesh, count, seed=rng)
    a, b, c = (u[faces[on, corner]] for corner in range(3))
    return np.asarray(points) / half, np.cross(b - a, c - a)


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
