"""Plain solids, small and large: cartons, cans, blocks, balls.

What they teach a completion is that what shows only flat or round sides is mostly solid, whatever
its size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.shapes import solids

if TYPE_CHECKING:
    import trimesh

LEAST, MOST = 0.05, 0.25  # metres, the longest side
FLAT = 0.35  # of it, the shortest that another side is


def draw_plain_shape(rng: np.random.Generator) -> trimesh.Trimesh:
    """A closed, outward mesh, metres, standing on z = 0: every second one a box, the others
    cylinders, standing or lying, prisms, cones with their tips cut off, and ellipsoids."""
    longest = float(np.exp(rng.uniform(np.log(LEAST), np.log(MOST))))
    size = longest * rng.permutation([1.0, *rng.uniform(FLAT, 1.0, 2)])
    kind = rng.integers(10)
    if kind < 5:
        mesh = solids.box(*size)
    elif kind < 7:
        mesh = solids.cylinder(size[0] / 2, size[2])
        if kind == 6:
            mesh = solids.laid_down(mesh)
    elif kind == 7:
        mesh = _prism(int(rng.integers(3, 9)), size[0] / 2, size[2])
    elif kind == 8:
        wide, narrow = size[0] / 2, size[0] / 2 * rng.uniform(0.4, 0.9)
        mesh = solids.revolve([(0, 0), (wide, 0), (narrow, size[2]), (0, size[2])])
    else:
        mesh = solids.ball(0.5)
        mesh.apply_scale(size)
    mesh.apply_translation([0, 0, -mesh.bounds[0][2]])
    return mesh


def _prism(sides: int, radius: float, height: float) -> trimesh.Trimesh:
    """Over a regular polygon."""
    import trimesh

    mesh = trimesh.creation.cylinder(radius, height, sections=sides)
    mesh.apply_translation([0, 0, height / 2])
    return mesh
