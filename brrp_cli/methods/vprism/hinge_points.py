"""Hinge points of a scene with many objects (V-PRISM, Wright et al. 2024)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import grid_nodes
from brrp_cli.seeds import child_rng


def scene_hinges(
    points: dict[int, NDArray[np.floating]],
    centers: dict[int, NDArray[np.float64]],
    *,
    spacing: float,
    radius: float,
    surface: int,
    seed: int,
) -> NDArray[np.float64]:
    """(H, 3) metres: one grid near the objects, and random points of each object's surface.

    points : object id -> (n, 3) seen points; centers : object id -> (3,)
    spacing : of the grid, whose points lie within `radius` of a centre
    surface : points drawn of each object, all of them where it has fewer
    """
    middles = np.array(list(centers.values()))
    lower, upper = middles.min(axis=0) - radius, middles.max(axis=0) + radius
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(lower, upper, strict=True)]
    grid = grid_nodes(axes).reshape(-1, 3)
    distance = np.linalg.norm(grid[:, None] - middles[None], axis=-1).min(axis=1)
    drawn = [
        child_rng(seed, "hinges", i).choice(p, min(surface, len(p)), replace=False)
        for i, p in points.items()
    ]
    return np.concatenate([grid[distance <= radius], *drawn]).astype(np.float64)
