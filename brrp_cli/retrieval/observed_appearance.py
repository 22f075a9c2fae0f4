"""What a frame shows of one object: colours, shape, size, and how much of it is hidden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.descriptors.colour_histogram import palette
from brrp_cli.descriptors.extents import footprint
from brrp_cli.descriptors.point_pairs import CELL, MIN_POINTS, pair_histogram
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane

# What lies lower above the plane may be the plane's: masks from depth take some of it along.
ABOVE_PLANE = 0.004
# Of the points of a mask that have to be left when those are taken away.
LEFT_SHARE = 0.5
# Stray points at the edges of a mask do not count for its size.
HEIGHT_QUANTILE = 0.995
WIDTH_SHARE = 0.986
NORMAL_RADIUS = 0.015
NORMAL_NEIGHBOURS = 30
# What stands in front of an outline by more than this hides something, metres; outlines are
# compared with what lies within so many pixels.
IN_FRONT = 0.01
REACH = 2


@dataclass(frozen=True)
class SeenObject:
    """One object of a frame.

    colours : (k, 3) RGB 0 to 255 and shares : (k,); None where the frame has no colours
    pairs : (PAIR_BINS,), see descriptors/point_pairs.py; None where there are too few points
    size : (3,) metres, height above the plane and footprint; None without plane or points
    hidden : share of the outline that ends at something in front of it or at the image's edge
    """

    colours: NDArray[np.float64] | None
    shares: NDArray[np.float64] | None
    pairs: NDArray[np.float32] | None
    size: NDArray[np.float64] | None
    hidden: float


def see_object(frame: Frame, object_id: int, plane: Plane | None) -> SeenObject:
    """Describe what is seen of one object."""
    mask = frame.segmap == object_id
    solid = _without_plane(frame, mask & frame.valid, plane)
    points = frame.points[solid].astype(np.float64)
    colours = shares = None
    # A frame that was made without colours is of one grey.
    if frame.rgb.min() < frame.rgb.max():
        colours, shares = palette(frame.rgb[_inner(solid if solid.any() else mask)])
    pairs = _pairs(points)
    size = None if plane is None or pairs is None else _size(points, plane)
    return SeenObject(colours, shares, pairs, size, _hidden(frame, mask))


def _without_plane(
    frame: Frame, solid: NDArray[np.bool_], plane: Plane | None
) -> NDArray[np.bool_]:
    if plane is None:
        return solid
    above = solid.copy()
    above[solid] = plane.signed_distance(frame.points[solid]) > ABOVE_PLANE
    return above if above.sum() >= LEFT_SHARE * solid.sum() else solid


def _inner(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Without the outermost pixels, whose colours are mixed, where that leaves something."""
    from scipy.ndimage import binary_erosion

    inner = binary_erosion(mask)
    return inner if inner.sum() >= 0.4 * mask.sum() else mask


def _pairs(points: NDArray[np.float64]) -> NDArray[np.float32] | None:
    if len(points) < MIN_POINTS:
        return None
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(CELL)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(NORMAL_RADIUS, NORMAL_NEIGHBOURS))
    cloud.orient_normals_towards_camera_location(np.zeros(3))
    histogram = pair_histogram(np.asarray(cloud.points), np.asarray(cloud.normals))
    return histogram if histogram.any() else None


def _size(points: NDArray[np.float64], plane: Plane) -> NDArray[np.float64]:
    height = np.quantile(plane.signed_distance(points), HEIGHT_QUANTILE)
    along = np.linalg.svd(plane.normal[None])[2][1:]
    return np.array([height, *footprint(points @ along.T, WIDTH_SHARE)])


def _hidden(frame: Frame, mask: NDArray[np.bool_]) -> float:
    from scipy.ndimage import binary_erosion, minimum_filter

    # Only what is around the object matters.
    rows, columns = np.nonzero(mask)
    low = np.maximum([rows.min() - REACH, columns.min() - REACH], 0)
    high = np.array([rows.max(), columns.max()]) + REACH + 1
    box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    here = mask[box]
    outline = here & ~binary_erosion(here)
    depth = np.where(frame.valid[box], frame.points[box][..., 2], np.inf)
    others = np.where(here, np.inf, depth)
    nearest = minimum_filter(others, size=2 * REACH + 1, mode="nearest")
    covered = (nearest < depth - IN_FRONT) & np.isfinite(depth)
    border = np.ones(mask.shape, dtype=bool)
    border[REACH:-REACH, REACH:-REACH] = False
    return float((outline & (covered | border[box])).sum() / max(outline.sum(), 1))
