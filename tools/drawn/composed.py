"""Solids of no kind: a few parts that run into each other.

What they teach a completion is how the unseen side of anything continues, and not what a mug is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.shapes import solids

if TYPE_CHECKING:
    import trimesh

PARTS = (1, 4)  # at least and at most
LEAST, MOST = 0.012, 0.09  # metres, extents of a part


def draw_composed_shape(rng: np.random.Generator) -> trimesh.Trimesh:
    """A closed, outward mesh, metres: 1 to 4 boxes, cylinders, ellipsoids and cones, each turned at
    random and with its middle in the box of the one before, so that most run into each other."""
    parts = [_turned(_part(rng), rng)]
    for _ in range(int(rng.integers(PARTS[0], PARTS[1] + 1)) - 1):
        last = parts[-1]
        part = _turned(_part(rng), rng)
        part.apply_translation(last.centroid + rng.uniform(-0.5, 0.5, 3) * last.extents)
        parts.append(part)
    return solids.union(*parts) if len(parts) > 1 else parts[0]


def _part(rng: np.random.Generator) -> trimesh.Trimesh:
    """About the origin."""
    size = np.exp(rng.uniform(np.log(LEAST), np.log(MOST), 3))
    kind = rng.integers(4)
    if kind == 0:
        mesh = solids.box(*size)
    elif kind == 1:
        mesh = solids.cylinder(size[0] / 2, size[1])
    elif kind == 2:
        mesh = solids.ball(0.5)
        mesh.apply_scale(size)
    else:
        narrow, wide, height = size[0] * rng.uniform(0.1, 0.9) / 2, size[0] / 2, size[1]
        mesh = solids.revolve([(0, 0), (wide, 0), (narrow, height), (0, height)])
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh


def _turned(mesh: trimesh.Trimesh, rng: np.random.Generator) -> trimesh.Trimesh:
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    mesh.apply_transform(T)
    return mesh
