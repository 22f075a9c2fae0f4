"""The true objects of a scene as rigid bodies of convex parts, which are made once and kept."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from brrp_cli.config.planning import PartsConfig
from brrp_cli.files import atomic_path
from brrp_cli.ground_truth.true_meshes import exact_truth
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.ground_truth.watertight import content_hash
from brrp_cli.planning.parts import COACD, HULL, convex_parts
from brrp_cli.raycast import raycasting_scene

Array = NDArray[np.float64]
# Hollows that are filled are shallower, metres: a finger finds the neck of a bottle.
CONCAVITY = 0.003
# On a hull, to tell whether a mesh is convex.
POINTS = 5_000


@dataclass(frozen=True)
class TrueBody:
    """An object's exact mesh and its convex parts (k, 3), in its own frame, metres, and its place
    T_world_object (4, 4), rigid."""

    object_id: int
    mesh: trimesh.Trimesh
    parts: list[Array]
    T_world_object: Array


def true_body(item: TrueObject, data_root: Path | None, cache: Path) -> TrueBody:
    """Errors: SceneError, MeshError for a mesh that cannot be read or closed."""
    T = np.array(item.T_world_object, dtype=np.float64)
    size = float(np.cbrt(np.linalg.det(T[:3, :3])))
    rigid = T.copy()
    rigid[:3, :3] /= size
    scaled = replace(item, T_world_object=np.diag([size, size, size, 1.0]))
    mesh = exact_truth(scaled, data_root, cache).mesh
    return TrueBody(item.id, mesh, _parts(mesh, cache), rigid)


def _parts(mesh: trimesh.Trimesh, cache: Path) -> list[Array]:
    kept = cache / f"{content_hash(mesh)}-parts-{1e3 * CONCAVITY:g}mm.npz"
    if kept.exists():
        with np.load(kept, allow_pickle=False) as arrays:
            return [arrays[name] for name in arrays.files]
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    # CoACD takes half a minute for what is convex already.
    how = HULL if _off_its_hull(mesh) < CONCAVITY else COACD
    parts = convex_parts(vertices, faces, how, 0, PartsConfig(concavity=CONCAVITY))
    with atomic_path(kept) as partial:
        np.savez_compressed(partial, *parts)
    return parts


def _off_its_hull(mesh: trimesh.Trimesh) -> float:
    """How far, metres, the hull of a mesh lies from it, at most."""
    hull = trimesh.convex.convex_hull(np.asarray(mesh.vertices))
    points, _ = trimesh.sample.sample_surface(hull, POINTS, seed=0)
    query = np.array(points, dtype=np.float32)
    distance = raycasting_scene([mesh]).compute_distance(query)
    return float(distance.numpy().max())
