"""Surfaces of one object as its posterior draws them, which rays are cast on.

The object is O = {x : p_i(x) > u}: particle i drawn by its share, level u uniform in (0, 1)
(brrp_cli/surface/confidence.py). A particle whose hypothesis is a stored shape is that shape's mesh
at a draw of its pose, which is what is in doubt about it; every other particle is a level set.
Particles and levels are drawn systematically: as often as their probability says, up to one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SurfaceConfig
from brrp_cli.config.grasping import GraspConfig
from brrp_cli.dependencies import import_library, import_open3d
from brrp_cli.grasping.scene import GraspObject
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.particles import particle_shares, particle_volumes
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.raycast import surface_scene
from brrp_cli.registration.turns import motions
from brrp_cli.surface.extract import grid_axes, level_set

Array = NDArray[np.float64]
# A hit further off than any ray of a hand goes.
NOTHING = np.inf


@dataclass(frozen=True)
class Mesh:
    """vertices (n, 3), metres, camera frame; faces (m, 3), outward."""

    vertices: Array
    faces: NDArray[np.int64]

    @cached_property
    def bounds(self) -> Array:
        """(2, 3) lower and upper corner."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def scene(self) -> Any:
        """It alone as Embree knows it; made once, for that takes longer than to ask it."""
        return surface_scene(self.vertices, self.faces)


def wall_mesh(corners: Array) -> Mesh:
    """The hull of corners (k, 3)."""
    hull = import_library("trimesh").convex.convex_hull(corners)
    return Mesh(np.asarray(hull.vertices, dtype=np.float64), np.asarray(hull.faces))


@dataclass(frozen=True)
class SurfaceDraws:
    """S surfaces of one object.

    meshes : the different ones; which : (S,) the mesh of each draw, -1 where the object is not
    there at all; T_mesh_cam : (S, 4, 4) rigid, from the camera frame to where the mesh was not
    moved yet
    """

    meshes: list[Mesh]
    which: NDArray[np.int64]
    T_mesh_cam: Array

    def __len__(self) -> int:
        return len(self.which)

    def only(self, draws: NDArray[np.int64]) -> SurfaceDraws:
        """Some of the draws."""
        return SurfaceDraws(self.meshes, self.which[draws], self.T_mesh_cam[draws])

    def cast(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Where rays first meet each draw: distance (S, n), inf where they do not, and outward
        normals (S, n, 3).

        origins, directions : (S, n, 3), unit directions, camera frame
        """
        distance = np.full(origins.shape[:2], NOTHING)
        normals = np.zeros(origins.shape)
        R, t = self.T_mesh_cam[:, :3, :3], self.T_mesh_cam[:, :3, 3]
        for number, mesh in enumerate(self.meshes):
            mine = np.flatnonzero(self.which == number)
            if not len(mine):
                continue
            back = np.swapaxes(R[mine], 1, 2)
            rays = np.concatenate(
                [origins[mine] @ back + t[mine][:, None], directions[mine] @ back], axis=-1
            )
            hit, facing = _cast(mesh.scene, rays)
            distance[mine], normals[mine] = hit, facing @ R[mine]
        return distance, normals


def mesh_alone(mesh: Mesh) -> SurfaceDraws:
    """One draw: the mesh where it is."""
    return SurfaceDraws([mesh], np.zeros(1, np.int64), np.eye(4)[None])


def draw_surfaces(
    item: GraspObject,
    own: Mesh,
    config: GraspConfig,
    surface: SurfaceConfig,
    rng: np.random.Generator,
) -> SurfaceDraws:
    """`config.draws` surfaces of an object; those of its `own` mesh alone where it has no
    posterior."""
    posterior = item.posterior
    if posterior is None:
        moves = np.repeat(np.eye(4)[None], config.draws, axis=0)
        return SurfaceDraws([own], np.zeros(config.draws, np.int64), moves)
    meshes = [own]
    which = np.full(config.draws, -1)
    moves = np.repeat(np.eye(4)[None], config.draws, axis=0)
    shapes = _placed_shapes(posterior, item)
    count = len(getattr(posterior, "shares", np.zeros(1)))
    shares = particle_shares(posterior, count)
    particles = _systematic(shares, config.draws, rng)
    levels: list[int] = []
    of_shape: dict[int, int] = {}
    for draw, particle in enumerate(particles):
        number = int(posterior.which[particle]) if shapes else -1  # type: ignore[attr-defined]
        shape = shapes.get(number)
        if shape is None:
            levels.append(draw)
            continue
        if number not in of_shape:
            of_shape[number] = 0 if shape.own else len(meshes)
            if not shape.own:
                meshes.append(Mesh(shape.shape.vertices, shape.shape.shape.faces.astype(np.int64)))
        which[draw] = of_shape[number]
        moves[draw] = np.linalg.inv(_small_motion(shape.shape, rng))
    found = _level_sets(item, particles[levels], config, surface, rng)
    for draw, mesh in zip(levels, found, strict=True):
        if mesh is None:
            continue
        known = next((i for i, other in enumerate(meshes) if other is mesh), None)
        if known is None:
            known = len(meshes)
            meshes.append(mesh)
        which[draw] = known
    return SurfaceDraws(meshes, which, moves)


@dataclass(frozen=True)
class _Shape:
    shape: PlacedShape
    own: bool  # whether the object's mesh is this shape's, moved to the level


def _placed_shapes(posterior: object, item: GraspObject) -> dict[int, _Shape]:
    """Stored shapes among the hypotheses, by number; none where the frame contradicts the one that
    the object was taken for, whose mesh is then a level set (surface/extract.py)."""
    if not isinstance(posterior, HypothesisPosterior):
        return {}
    found = {
        number: _Shape(mean, number == posterior.dominant)
        for number, mean in enumerate(posterior.means)
        if isinstance(mean, PlacedShape)
    }
    if posterior.dominant is not None:
        faces = found[posterior.dominant].shape.shape.faces
        if len(faces) != len(item.faces):
            return {}
    return found


def _small_motion(shape: PlacedShape, rng: np.random.Generator) -> Array:
    """(4, 4) rigid, camera frame: a draw of how far the shape is from where it was placed."""
    # A covariance of measured numbers may be indefinite by rounding.
    values, vectors = np.linalg.eigh((shape.covariance + shape.covariance.T) / 2)
    drawn = vectors @ (np.sqrt(np.maximum(values, 0)) * rng.normal(size=6))
    return motions(drawn[None], shape.T_cam_shape[:3, 3])[0]


def _level_sets(
    item: GraspObject,
    particles: NDArray[np.int64],
    config: GraspConfig,
    surface: SurfaceConfig,
    rng: np.random.Generator,
) -> list[Mesh | None]:
    """A level set of each of `particles` (k,); None where nothing of it is near what was seen."""
    if not len(particles) or item.posterior is None:
        return []
    margin = np.array([[-config.around], [config.around]])
    near = np.stack([item.vertices.min(axis=0), item.vertices.max(axis=0)]) + margin
    bounds = item.posterior.bounds
    box = np.stack([np.maximum(near[0], bounds[0]), np.minimum(near[1], bounds[1])])
    size = np.maximum(box[1] - box[0], config.finest)
    spacing = float(np.cbrt(np.prod(size) / config.nodes))
    axes = grid_axes(box, float(np.clip(spacing, config.finest, config.coarsest)))
    volumes = particle_volumes(item.posterior, axes)
    # Every part that was seen counts: how parts hang together is not for a grasp to say.
    parts = replace(surface, one_piece=False)
    distinct = min(config.surfaces, len(particles))
    chosen = np.linspace(0, len(particles), distinct, endpoint=False).astype(int)
    levels = (rng.permutation(distinct) + rng.random(distinct)) / distinct
    found: list[Mesh | None] = []
    for particle, level in zip(particles[chosen], levels, strict=True):
        mesh = level_set(volumes[particle], axes, item.observed, float(level), parts)
        found.append(None if mesh is None else Mesh(mesh.vertices, mesh.faces))
    turn = np.searchsorted(chosen, np.arange(len(particles)), side="right") - 1
    return [found[i] for i in turn]


def _systematic(shares: Array, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """(count,) indices, ascending, drawn in proportion to shares (P,) by systematic sampling."""
    places = (np.arange(count) + rng.random()) / count
    return np.minimum(np.searchsorted(np.cumsum(shares), places), len(shares) - 1)


def _cast(scene: Any, rays: Array) -> tuple[Array, Array]:
    """Distances (...) and normals (..., 3), which are outward as the mesh is."""
    o3d = import_open3d()
    found = scene.cast_rays(o3d.core.Tensor(np.ascontiguousarray(rays, np.float32)), nthreads=1)
    return found["t_hit"].numpy().astype(np.float64), found["primitive_normals"].numpy()
