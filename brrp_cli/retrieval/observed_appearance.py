"""What a frame shows of one object: colours, shape, size, and how much of it is hidden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import ObservedAppearanceConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.descriptors.colour_histogram import palette
from brrp_cli.descriptors.extents import footprint
from brrp_cli.descriptors.point_pairs import CELL, MIN_POINTS, pair_histogram
from brrp_cli.frames.dilate import mask_box
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane


@dataclass(frozen=True)
class ObservedAppearance:
    """One object of a frame.

    colours : (k, 3) RGB 0 to 255 and shares : (k,); None where the frame has no colours
    pairs : (PAIR_BINS,), see descriptors/point_pairs.py; None where there are too few points
    size : (3,) metres, height above the plane and footprint; None without plane or points
    points : (n, 3) metres, camera frame, without the plane's
    hidden : share of the silhouette that ends at something in front of it or at the image's edge
    hueless : whether the image is one of brightness alone
    """

    colours: NDArray[np.float64] | None
    shares: NDArray[np.float64] | None
    pairs: NDArray[np.float32] | None
    size: NDArray[np.float64] | None
    points: NDArray[np.float64]
    hidden: float
    hueless: bool = False


def see_object(
    frame: Frame, object_id: int, plane: Plane | None, config: ObservedAppearanceConfig
) -> ObservedAppearance:
    """Describe what is seen of one object."""
    whole = frame.segmap == object_id
    # Only what is around the object matters.
    box = mask_box(whole, config.reach)
    mask, seen = whole[box], frame.points[box]
    solid = _without_plane(seen, mask & frame.valid[box], plane, config)
    points = seen[solid].astype(np.float64)
    colours = shares = None
    if frame.coloured:
        # Depth that is missing is missing of what is dark or shiny, not of any part.
        sparse = frame.valid[box][mask].sum() < config.sparse * mask.sum()
        inner = _inner(mask if sparse or not solid.any() else solid, config.inner)
        colours, shares = palette(frame.rgb[box][inner])
    pairs = _pairs(points, config)
    size = None if plane is None or pairs is None else _size(points, plane, config)
    return ObservedAppearance(
        colours, shares, pairs, size, points, _hidden(frame, mask, box, config), frame.hueless
    )


def _without_plane(
    seen: NDArray[np.floating],
    solid: NDArray[np.bool_],
    plane: Plane | None,
    config: ObservedAppearanceConfig,
) -> NDArray[np.bool_]:
    if plane is None:
        return solid
    above = solid.copy()
    above[solid] = plane.signed_distance(seen[solid]) > config.above_plane
    return above if above.sum() >= config.left * solid.sum() else solid


def _inner(mask: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Without the outermost pixels, whose colours are mixed, where that leaves something."""
    from scipy.ndimage import binary_erosion

    inner = binary_erosion(mask)
    return inner if inner.sum() >= least * mask.sum() else mask


def _pairs(
    points: NDArray[np.float64], config: ObservedAppearanceConfig
) -> NDArray[np.float32] | None:
    if len(points) < MIN_POINTS:
        return None
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(CELL)
    near = o3d.geometry.KDTreeSearchParamHybrid(config.normal_radius, config.normal_neighbours)
    cloud.estimate_normals(near)
    cloud.orient_normals_towards_camera_location(np.zeros(3))
    histogram = pair_histogram(np.asarray(cloud.points), np.asarray(cloud.normals))
    return histogram if histogram.any() else None


def _size(
    points: NDArray[np.float64], plane: Plane, config: ObservedAppearanceConfig
) -> NDArray[np.float64]:
    height = np.quantile(plane.signed_distance(points), config.height_quantile)
    along = np.linalg.svd(plane.normal[None])[2][1:]
    return np.array([height, *footprint(points @ along.T, config.width_share)])


def _hidden(
    frame: Frame,
    mask: NDArray[np.bool_],
    box: tuple[slice, slice],
    config: ObservedAppearanceConfig,
) -> float:
    from scipy.ndimage import binary_erosion, minimum_filter

    reach = config.reach
    silhouette = mask & ~binary_erosion(mask)
    depth = np.where(frame.valid[box], frame.points[box][..., 2], np.inf)
    others = np.where(mask, np.inf, depth)
    nearest = minimum_filter(others, size=2 * reach + 1, mode="nearest")
    covered = (nearest < depth - config.in_front) & np.isfinite(depth)
    border = np.ones(frame.shape, dtype=bool)
    border[reach:-reach, reach:-reach] = False
    return float((silhouette & (covered | border[box])).sum() / max(silhouette.sum(), 1))
