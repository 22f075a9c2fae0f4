"""Appearance descriptors of one mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brrp_cli.descriptors.colour_histogram import COLOUR_BINS, colour_histograms, palette
from brrp_cli.descriptors.descriptor import Appearance, to_bytes
from brrp_cli.descriptors.extents import standing_size
from brrp_cli.descriptors.point_pairs import pair_histogram
from brrp_cli.geometry import transform_points
from brrp_cli.prior.build.coloured_mesh import PaintedMesh
from brrp_cli.prior.build.views import SeenSide, views_around
from brrp_cli.prior.objects import RestingPose
from brrp_cli.prior.parameters import AppearanceConfig

if TYPE_CHECKING:
    import trimesh


def describe_appearance(
    painted: PaintedMesh,
    closed: trimesh.Trimesh,
    poses: list[RestingPose],
    config: AppearanceConfig,
) -> Appearance:
    """Colour and shape of `painted`, the mesh as it was given; sizes of `closed`, its repaired
    surface, in `poses`. Both in the mesh's own metres."""
    sides = views_around(painted, config.views, config.rays)
    hull = np.asarray(closed.convex_hull.vertices)
    return Appearance(
        colour=to_bytes(np.stack([_colour(side) for side in sides])),
        pairs=to_bytes(np.stack([pair_histogram(side.points, side.normals) for side in sides])),
        sizes=np.array(
            [standing_size(transform_points(pose.T_plane_object, hull)) for pose in poses],
            dtype=np.float32,
        ),
    )


def _colour(side: SeenSide) -> np.ndarray:
    known = side.rgb[np.isfinite(side.rgb).all(axis=-1)]
    if len(known) == 0:
        return np.zeros(COLOUR_BINS, np.float32)
    return colour_histograms(*palette(known), np.ones((1, 3)))[0]
