"""What masks are made from: smoothed depth, its normals and edges, and the table under it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.last_frame import kept_for_last_image
from brrp_cli.geometry import backproject
from brrp_cli.segmentation.concave_edges import depth_jumps, hollow_angles, surface_normals
from brrp_cli.segmentation.seen_table import see_table
from brrp_cli.segmentation.smooth_depth import flying_pixels, smooth_depth
from brrp_cli.segmentation.table_plane import Table

Array = NDArray[np.floating]


@dataclass(frozen=True)
class SeenSurfaces:
    """What a frame shows, after depth was smoothed and flying pixels were left out.

    depth : (H, W) metres, NaN = none; points : (H, W, 3) metres, camera frame; valid : (H, W)
    height : (H, W) metres above the table or a floor of a bin; plan : (H, W, 2) metres, on it;
    beside : (H, W) metres beside the table, seen or beyond the image, 0 or less on it; NaN where
    there is no depth
    normals : (H, W, 3) unit, toward the camera; angles : (H, W) degrees of hollow creases; jumps :
    (H, W) pixels beside which depth jumps
    """

    depth: NDArray[np.float64]
    points: Array
    valid: NDArray[np.bool_]
    table: Table
    height: NDArray[np.float64]
    plan: NDArray[np.float64]
    beside: NDArray[np.float64]
    normals: Array
    angles: Array
    jumps: NDArray[np.bool_]


@kept_for_last_image
def see_surfaces(frame: Frame, seed: int, config: SegmentConfig) -> SeenSurfaces:
    """What `frame` shows. Errors: FrameError if it has too little depth, or no table."""
    depth = smoothed_depth(frame, config)
    points = backproject(depth, frame.K)
    valid = np.isfinite(depth)
    if valid.sum() < config.least_depth * valid.size:
        raise FrameError(
            "Too little depth to find objects in",
            where=frame.source,
            expected="depth that neighbours agree on, at"
            f" {config.least_depth:.0%} of the pixels or more",
            found=f"{int(frame.valid.sum())} of {valid.size} pixels have depth,"
            f" {int(valid.sum())} of them agree with their neighbours",
            fix="check the depth image and its unit; masks made elsewhere go in by --masks",
        )
    found = see_table(points, frame.K, seed, frame.source, config)
    normals = surface_normals(points, config.concave_edges)
    return SeenSurfaces(
        depth,
        points,
        valid,
        found.table,
        found.height,
        found.plan,
        found.beside,
        normals,
        hollow_angles(points, normals, config.concave_edges),
        depth_jumps(depth, frame.K, config.concave_edges),
    )


def smoothed_depth(frame: Frame, config: SegmentConfig) -> NDArray[np.float64]:
    """Depth (H, W), metres, without flying pixels and averaged over each surface; NaN = none."""
    raw = np.where(frame.valid, frame.points[..., 2], np.nan)
    flying = flying_pixels(raw, config.smooth_depth)
    return smooth_depth(np.where(flying, np.nan, raw), config.smooth_depth)
