"""Labelled samples of an object, and points on its surface (paper, section IV-A)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.prior.parameters import SampleMix
from brrp_cli.raycast import raycasting_scene

if TYPE_CHECKING:
    import trimesh

Points = NDArray[np.float32]

# Three rays a query: one that grazes an edge is outvoted.
RAYS = 3


def inside(mesh: trimesh.Trimesh, points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which of `points` (n, 3) lie inside a closed mesh; both in one frame and unit."""
    scene = raycasting_scene([mesh], threads=1)
    query = import_open3d().core.Tensor(np.ascontiguousarray(points, dtype=np.float32))
    return np.asarray(scene.compute_occupancy(query, nthreads=1, nsamples=RAYS).numpy() > 0.5)


def draw_samples(
    mesh: trimesh.Trimesh, count: int, mix: SampleMix, rng: np.random.Generator
) -> tuple[Points, NDArray[np.bool_]]:
    """`count` points (n, 3) around a closed normalised mesh and their labels, True = inside.

    The order is shuffled, so that every leading part has the whole's mix.
    """
    n_near = round(count * (1 - mix.uniform))
    points = rng.uniform(-mix.reach, mix.reach, size=(count - n_near, 3))
    near, _ = surface_points(mesh, n_near, rng)
    sigma = np.resize(np.asarray(mix.offsets, dtype=np.float64), n_near)[:, None]
    near = near + rng.normal(size=(n_near, 3)) * sigma
    samples = rng.permutation(np.concatenate([points, near])).astype(np.float32)
    return samples, inside(mesh, samples)


def surface_points(
    mesh: trimesh.Trimesh, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`count` points (n, 3) on the surface, by area, and the normals (n, 3) of their faces."""
    import trimesh

    points, faces = trimesh.sample.sample_surface(mesh, count, seed=rng)
    return np.asarray(points, dtype=np.float64), np.asarray(mesh.face_normals)[faces]
