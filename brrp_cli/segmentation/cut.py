"""One mask cut into pieces where its inner boundary is strongest."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_image
from brrp_cli.geometry import backproject
from brrp_cli.segmentation.agglomerate import borders_of
from brrp_cli.segmentation.components import find_parts, split_at_strongest
from brrp_cli.segmentation.concave_edges import depth_jumps, hollow_creases, surface_normals
from brrp_cli.segmentation.learned_affinities import affinities_in
from brrp_cli.segmentation.seen_surfaces import smoothed_depth
from brrp_cli.segmentation.upright import see_upright, turned_back

log = logging.getLogger(__name__)


@kept_for_last_image
def boundary_of(frame: Frame, seed: int, config: SegmentConfig) -> NDArray[np.float64]:
    """Where one thing ends (H, W), 0 to 1: jumps of depth, and borders that the network sees, or
    hollow creases where there is no table, which it needs."""
    try:
        standing, seen, turns = see_upright(frame, seed, config)
    except FrameError:
        log.info("No table is seen: masks are cut at jumps of depth and hollow creases alone")
        return _without_a_table(frame, config)
    affinities = affinities_in(standing, seen, config)
    boundary = np.maximum(affinities.restore(borders_of(affinities)), seen.jumps)
    return turned_back(boundary, turns)


def _without_a_table(frame: Frame, config: SegmentConfig) -> NDArray[np.float64]:
    depth, edges = smoothed_depth(frame, config), config.concave_edges
    points = backproject(depth, frame.K)
    crease = hollow_creases(points, surface_normals(points, edges), edges)
    return np.maximum(crease, depth_jumps(depth, frame.K, edges))


def cut_at_strongest(
    mask: NDArray[np.bool_], boundary: NDArray[np.float64], pieces: int, config: SegmentConfig
) -> NDArray[np.int64] | None:
    """Labels (H, W) of so many parts of a mask (H, W), of pixels with depth, 0 = in none; None
    where it has no such boundary inside."""
    parts = split_at_strongest(find_parts(mask, boundary, config.components), boundary, pieces)
    return parts if len(np.unique(parts[parts > 0])) == pieces else None


def filled(mask: NDArray[np.bool_], parts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Labels (H, W) of all of a mask: pixels that are in no part, without depth or at edges, go to
    the nearest; 0 outside the mask."""
    ndimage = import_library("scipy.ndimage")
    rows, columns = ndimage.distance_transform_edt(
        parts == 0, return_distances=False, return_indices=True
    )
    return np.where(mask, parts[rows, columns], 0)
