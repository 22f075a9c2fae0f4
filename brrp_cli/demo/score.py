"""Scores of a reconstruction against the demo's known truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.ground_truth.metrics import chamfer, evaluation_grid, iou, sample_surface
from brrp_cli.raycast import inside
from brrp_cli.seeds import child_rng

if TYPE_CHECKING:
    import trimesh

HALF_WIDTH, SPACING = 0.2, 0.005  # metres, around the centre of the true mesh
SURFACE_POINTS = 8_000


@dataclass(frozen=True)
class Score:
    """iou : 0 to 1; chamfer : metres, NaN without a reconstruction."""

    iou: float
    chamfer: float


def score(reconstructed: trimesh.Trimesh | None, truth: trimesh.Trimesh, seed: int) -> Score:
    """Compare two closed meshes of one object, both in metres in one frame.

    IoU on a 5 mm grid; Chamfer distance between 8,000 points of each surface. None is a
    reconstruction that holds nothing.
    """
    if reconstructed is None or len(reconstructed.faces) == 0:
        return Score(iou=0.0, chamfer=float("nan"))
    grid = evaluation_grid(truth.bounds.mean(axis=0), HALF_WIDTH, SPACING)
    surfaces = [
        sample_surface(mesh, SURFACE_POINTS, child_rng(seed, "score", side))
        for side, mesh in (("reconstructed", reconstructed), ("true", truth))
    ]
    return Score(
        iou=iou(inside(reconstructed, grid), inside(truth, grid)),
        chamfer=chamfer(np.asarray(surfaces[0]), np.asarray(surfaces[1])),
    )
