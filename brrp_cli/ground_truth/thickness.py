"""How thick a closed mesh is from one side to the other, and the class that follows from it.

The thickness at a point of the surface is the way along the inward normal to the other side
(Shapira, Shamir and Cohen-Or, "Consistent mesh partitioning and skeletonisation using the shape
diameter function", The Visual Computer 24, 2008, with a single ray for their cone). The median over
the surface tells a shell from a solid, whatever the size of its box: a bowl is a shell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.dependencies import import_open3d
from brrp_cli.raycast import raycasting_scene

if TYPE_CHECKING:
    import trimesh

SHELL, THIN, SOLID = "shell", "thin", "solid"
THICKNESS_CLASSES = (SHELL, THIN, SOLID)
SHELL_LIMIT, THIN_LIMIT = 0.005, 0.025  # metres
POINTS = 2_000
# Rays start so far below the surface, in units of the box's diagonal, to miss their own face.
_START = 1e-5


def median_thickness(mesh: trimesh.Trimesh) -> float:
    """Median over the surface of a closed, outward mesh, in its units; NaN without a surface."""
    import trimesh

    if not mesh.area > 0:
        return float("nan")
    o3d = import_open3d()
    # One seed for all: thickness belongs to the mesh, not to the run.
    points, faces = trimesh.sample.sample_surface(mesh, POINTS, seed=0)
    center = mesh.bounds.mean(axis=0)
    inward = -mesh.face_normals[faces]
    start = _START * float(np.linalg.norm(mesh.extents))
    rays = np.hstack([points - center + start * inward, inward]).astype(np.float32)
    scene = raycasting_scene([mesh.copy().apply_translation(-center)])
    way = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
    # A ray through an edge may miss both of its faces.
    hit = way[np.isfinite(way)]
    return float(np.median(hit)) + start if len(hit) else float("nan")


def thickness_class(thickness: float) -> str:
    """Of `THICKNESS_CLASSES`, for a median thickness in metres: a shell under 5 mm, thin under
    25 mm, else solid."""
    if thickness < SHELL_LIMIT:
        return SHELL
    return THIN if thickness < THIN_LIMIT else SOLID
