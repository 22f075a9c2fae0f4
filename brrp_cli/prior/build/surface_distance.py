"""How far two surfaces lie apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.dependencies import import_open3d
from brrp_cli.raycast import surface_scene

if TYPE_CHECKING:
    import trimesh

POINTS = 5_000


def surface_distances(
    original: trimesh.Trimesh, repaired: trimesh.Trimesh, *, same: bool
) -> dict[str, dict[str, float]]:
    """Mean and maximum distance both ways, metres, from 5,000 points on each surface.

    `same`: the surfaces are known to be one, and nothing is measured.
    """
    if same:
        zero = {"mean": 0.0, "max": 0.0}
        return {"original_to_repaired": zero, "repaired_to_original": dict(zero)}
    return {
        "original_to_repaired": _distances(original, repaired),
        "repaired_to_original": _distances(repaired, original),
    }


def _distances(source: trimesh.Trimesh, target: trimesh.Trimesh) -> dict[str, float]:
    import trimesh

    o3d = import_open3d()
    center = target.bounds.mean(axis=0)
    scene = surface_scene(target.vertices - center, target.faces)
    points, _ = trimesh.sample.sample_surface(source, POINTS, seed=0)
    query = o3d.core.Tensor(np.asarray(points - center, dtype=np.float32))
    distance = scene.compute_distance(query, nthreads=1).numpy().astype(np.float64)
    # Rays and distances are float32; below a micrometre they only tell that.
    return {
        "mean": round(float(distance.mean()), 6),
        "max": round(float(distance.max()), 6),
    }
