"""Marching cubes over a cube, whatever it holds."""

from __future__ import annotations

import torch
from torch import Tensor

from brrp_cli.config import InferenceConfig
from plain.density import dense_features, hinge_points

# Metres; the spacing is that of the published evaluation's grid.
HALF_WIDTH, SPACING = 0.4, 0.015
CHUNK = 4096


def surface(particles: Tensor, config: InferenceConfig, level: float) -> tuple | None:
    """Vertices and faces, in cells, of the mean occupancy of particles (P, H + 1); None without."""
    from skimage.measure import marching_cubes

    hinges, width = hinge_points(config.hinges_per_axis, config.hinge_half_width)
    axis = torch.arange(-HALF_WIDTH, HALF_WIDTH, SPACING)
    nodes = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), dim=-1).reshape(-1, 3)
    parts = []
    for part in nodes.split(CHUNK):
        phi = dense_features(part, hinges, width, config.feature_floor)
        parts.append(torch.sigmoid(particles @ phi.T).mean(dim=0))
    volume = torch.cat(parts).reshape(len(axis), len(axis), len(axis)).numpy()
    if not volume.min() < level < volume.max():
        return None
    vertices, faces, _, _ = marching_cubes(volume, level)
    return vertices, faces
