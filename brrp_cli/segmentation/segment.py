"""Object masks without a model: what stands on the table, apart in depth.

Depth is smoothed and freed of flying pixels. What rises above the table is cut at jumps of depth
and at hollow creases, which is how things that touch meet; parts of which one is the inside of the
other (a mug's walls), or that are of one vivid colour on one spot, are joined again.
"""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import ConcaveEdgesConfig, SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject
from brrp_cli.segmentation.components import absorb_small, find_parts, join_alike, join_parts
from brrp_cli.segmentation.concave_edges import (
    colour_edges,
    depth_jumps,
    hollow_angles,
    strength,
    surface_normals,
)
from brrp_cli.segmentation.fill_concavities import fill_inside
from brrp_cli.segmentation.left_out import IN_THE_AIR, left_out, told
from brrp_cli.segmentation.merge_by_footprint import join_on_one_spot
from brrp_cli.segmentation.refine_borders import refine_borders
from brrp_cli.segmentation.region_growing import fill_holes, grow
from brrp_cli.segmentation.smooth_depth import flying_pixels, smooth_depth
from brrp_cli.segmentation.split_stacks import split_stacks
from brrp_cli.segmentation.table_plane import Table, find_table

log = logging.getLogger(__name__)

# Of the image, that must have depth which agrees with its neighbours'.
MIN_SHARE = 0.01


def segment(
    frame: Frame, seed: int = 0, config: SegmentConfig | None = None, *, keep_all: bool = False
) -> NDArray[np.int64]:
    """Masks (H, W) of the objects that stand on the table: 1, 2, ... from left to right.

    keep_all : also of what the image's border cuts, and of what stands nowhere on the table
        (left_out.py)

    The frame's own masks are not looked at; background, also behind the table, is 0, and so are
    pixels without depth but for small holes inside an object.

    Errors: FrameError if there is no table or nothing stands on it.
    """
    return segment_and_aside(frame, seed, config, keep_all=keep_all)[0]


def segment_and_aside(
    frame: Frame, seed: int = 0, config: SegmentConfig | None = None, *, keep_all: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """What `segment` gives, and the masks (H, W) that it left out because they seem to stand
    nowhere on the table, 0 = none: what lies on something else may look like that."""
    ndimage = import_library("scipy.ndimage")
    config = config or SegmentConfig()
    raw = np.where(frame.valid, frame.points[..., 2], np.nan)
    smoothing = config.smooth_depth
    depth = smooth_depth(np.where(flying_pixels(raw, smoothing), np.nan, raw), smoothing)
    points = backproject(depth, frame.K)
    valid = np.isfinite(depth)
    if valid.sum() < MIN_SHARE * valid.size:
        raise FrameError(
            "Too little depth to find objects in",
            where=frame.source,
            expected=f"depth that neighbours agree on, at {MIN_SHARE:.0%} of the pixels or more",
            found=f"{int(frame.valid.sum())} of {valid.size} pixels have depth,"
            f" {int(valid.sum())} of them agree with their neighbours",
            fix="check the depth image and its unit; masks made elsewhere go in by --masks",
        )
    table = find_table(points[valid], seed, frame.source, config.table)
    height = table.plane.signed_distance(points)
    plan = table.plan(points)
    lift = _lift(height, depth, config)
    with np.errstate(invalid="ignore"):
        on_table = np.zeros(frame.shape, dtype=bool)
        on_table[valid] = table.holds(plan[valid], config.margin)
        risen = on_table & (height > lift)
        rim = on_table & (height > config.rim * lift)
        floor = on_table & (height > -config.max_height)
    normals = surface_normals(points, config.concave_edges)
    sharp, crease = _creases(points, normals, frame.rgb, config.concave_edges)
    jumps = depth_jumps(depth, frame.K, config.concave_edges)
    boundary = np.maximum(crease, jumps)
    # Across a jump nothing meets, however the surfaces on both sides lie.
    meets = np.where(ndimage.binary_dilation(jumps, iterations=2), 0.0, sharp)
    parts = find_parts(risen, boundary, config.components)
    parts = join_parts(parts, boundary, config.border, config.components)
    if config.concave_edges.faint < 1:
        # A crease that only colour made strong parts what differs in colour as a whole.
        sharp = np.maximum(sharp, jumps)
        parts = join_alike(parts, sharp, frame.rgb, config.border, config.components)
    parts = join_on_one_spot(parts, plan, height, table.plan(normals), meets, frame.rgb, config)
    parts = split_stacks(parts, frame.rgb, height, config.stacks)
    small = _areas(parts, frame) < config.min_area
    segmap = absorb_small(parts, boundary, small)
    # Pixels at edges, which were left out of the smoothed depth, join what they lie next to.
    edges = frame.valid & ~valid & (table.plane.signed_distance(frame.points) > config.rim * lift)
    points = np.where(edges[..., None], frame.points, points)
    segmap = grow(segmap, points, rim | edges, config.reach)
    # Specks would grow with their borders.
    segmap = _large(segmap, frame, config.min_area)
    filled = fill_inside(segmap, table.plan(points), floor, config.concavities)
    segmap = refine_borders(filled, frame.rgb, filled != segmap, config.borders)
    segmap = fill_holes(segmap, ~frame.valid)
    aside = np.zeros_like(segmap)
    if not keep_all:
        segmap, aside = _without(segmap, frame, table, config)
    return _numbered(segmap, frame, config.min_area), aside


def _creases(
    points: NDArray[np.floating],
    normals: NDArray[np.floating],
    rgb: NDArray[np.uint8],
    config: ConcaveEdgesConfig,
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Hollow creases (H, W), 0 to 1: sharp ones alone, and with faint ones where colour changes."""
    angles = hollow_angles(points, normals, config)
    sharp = strength(angles, config.flat, config.sharp)
    if config.faint == 1:
        return sharp, sharp
    faint = strength(angles, config.faint * config.flat, config.faint * config.sharp)
    return sharp, np.maximum(sharp, faint * colour_edges(rgb, config))


def _without(
    segmap: NDArray[np.int64], frame: Frame, table: Table, config: SegmentConfig
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The masks without those that are left out, which the log tells, and of the latter those that
    stand nowhere."""
    segmap = _large(segmap, frame, config.min_area)
    points = np.where(frame.valid[..., None], frame.points, np.nan)
    height = table.plane.signed_distance(points)
    reasons = left_out(segmap, points[..., 2], height, config.left_out)
    if reasons:
        log.info("Masks left out: %s (--all keeps them)", told(reasons))
    in_the_air = [i for i, reason in reasons.items() if reason == IN_THE_AIR]
    return (
        np.where(np.isin(segmap, list(reasons)), BACKGROUND, segmap),
        np.where(np.isin(segmap, in_the_air), segmap, BACKGROUND),
    )


def _lift(
    height: NDArray[np.float64], depth: NDArray[np.float64], config: SegmentConfig
) -> NDArray[np.float64]:
    """(H, W) metres above which something has risen from the table at its depth (H, W)."""
    flat = np.abs(height) < config.max_height
    scaled = height[flat] / depth[flat] ** 2
    # The median of deviations, times what makes it the deviation of a normal distribution.
    deviation = 1.4826 * float(np.median(np.abs(scaled - np.median(scaled)))) if flat.any() else 0.0
    depth = np.nan_to_num(depth, nan=float(np.nanmedian(depth)))
    return np.clip(config.sigmas * deviation * depth**2, config.min_height, config.max_height)


def _areas(segmap: NDArray[np.int64], frame: Frame) -> NDArray[np.float64]:
    """(n + 1,) what each label shows of itself, metres squared, as if seen face on."""
    area = np.nan_to_num(frame.points[..., 2] ** 2) / (frame.K[0, 0] * frame.K[1, 1])
    return np.asarray(np.bincount(segmap.ravel(), weights=area.ravel()), dtype=np.float64)


def _large(segmap: NDArray[np.int64], frame: Frame, min_area: float) -> NDArray[np.int64]:
    """The masks that show so many metres squared of themselves."""
    return np.where(_areas(segmap, frame)[segmap] >= min_area, segmap, BACKGROUND)


def _numbered(segmap: NDArray[np.int64], frame: Frame, min_area: float) -> NDArray[np.int64]:
    """The masks without small ones, numbered by the column of their middle."""
    areas = _areas(segmap, frame)
    columns = np.broadcast_to(np.arange(frame.shape[1]), frame.shape)
    middles = {
        int(i): float(columns[segmap == i].mean())
        for i in np.flatnonzero(areas >= min_area)
        if i != BACKGROUND
    }
    if not middles:
        raise FrameError(
            "Nothing stands on the table",
            where=frame.source,
            expected="objects that rise above their support plane",
            found=f"none that shows {min_area * 1e4:g} cm^2 of itself",
            fix="check the unit of depth (--depth-scale), move the camera nearer, keep what the"
            " image's border cuts (--all), or pass masks with --masks",
        )
    numbered = np.zeros_like(segmap)
    for number, old in enumerate(sorted(middles, key=lambda i: middles[i]), start=1):
        numbered[segmap == old] = number
    return numbered
