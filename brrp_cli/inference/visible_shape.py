"""The shape that fills in for an object that no stored one explains, from what was seen of it.

It is closed, stands on the support plane, and is as large as what is visible:

- within the convex hull of the observed points and of their feet on the plane, which is drawn in
  the further from an observed point one comes: backs are not as wide as fronts suggest;
- under an observed point: what is seen from above shows where the object ends along the plane.

Hollows that the camera did not see to be free are filled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing, maximum_filter
from scipy.spatial import ConvexHull, QhullError, cKDTree

from brrp_cli.config import VisibleShapeConfig
from brrp_cli.frames.plane import Plane
from brrp_cli.frames.subsample import grid_subsample
from brrp_cli.geometry import transform_points
from brrp_cli.registration.starts import plane_frame

Array = NDArray[np.float64]

# Points in one plane have no hull: they are moved by this standard deviation, metres.
THICKNESS = 0.0005


@dataclass(frozen=True)
class VisibleShape:
    """seen : (n, 3) observed points, metres, camera frame, thinned; feet : (m, 3) theirs on the
    plane, none without one; facets : (f, 4) of their hull, outward unit normal and offset; roof :
    heights over the plane, None without one."""

    seen: Array
    feet: Array
    facets: Array
    roof: Roof | None
    config: VisibleShapeConfig

    @property
    def extent(self) -> Array:
        """(n + m, 3) points that span the shape."""
        return np.concatenate([self.seen, self.feet])

    def signed_distance(self, points: Array) -> Array:
        """About how far points (n, 3), metres, camera frame, are outside (n,); negative inside."""
        outside = (points @ self.facets[:, :3].T + self.facets[:, 3]).max(axis=1)
        away, _ = cKDTree(self.seen).query(points)
        found = outside + self.config.shrink * away - self.config.growth
        if self.roof is not None:
            found = np.maximum(found, self.roof.above(points))
        return np.asarray(found)


@dataclass(frozen=True)
class Roof:
    """The greatest observed height over each cell of the plane, -1 where nothing was seen.

    T_plane_cam : (4, 4); first : (2,) index of the first cell; heights : (a, b), metres
    """

    T_plane_cam: Array
    cell: float
    first: NDArray[np.int64]
    heights: Array

    def above(self, points: Array) -> Array:
        """Height (n,) of points (n, 3), metres, camera frame, over the roof; negative under it."""
        placed = transform_points(self.T_plane_cam, points)
        cells = np.floor(placed[:, :2] / self.cell).astype(np.int64) - self.first
        inside = ((cells >= 0) & (cells < self.heights.shape)).all(axis=1)
        roof = np.full(len(points), -1.0)
        roof[inside] = self.heights[tuple(cells[inside].T)]
        return np.asarray(placed[:, 2] - roof)


def visible_shape(
    points: NDArray[np.floating], plane: Plane | None, config: VisibleShapeConfig
) -> VisibleShape:
    """From an object's observed points (n, 3), metres, camera frame, and its support plane."""
    seen = grid_subsample(points, config.cell).astype(np.float64)
    if plane is None:
        return VisibleShape(seen, np.zeros((0, 3)), hull_facets(seen), None, config)
    height = np.maximum(plane.signed_distance(seen), 0.0)
    feet = seen - height[:, None] * plane.normal
    facets = hull_facets(np.concatenate([seen, feet]))
    return VisibleShape(seen, feet, facets, roof_over(points, plane, config), config)


def hull_facets(points: Array) -> Array:
    """The convex hull of points (n, 3) as facets (f, 4): outward unit normal and offset."""
    try:
        hull = ConvexHull(points)
    except QhullError:
        # Fewer than four points, or all in one plane.
        rng = np.random.default_rng(0)
        copies = np.concatenate([points] * 4)
        hull = ConvexHull(copies + rng.normal(0, THICKNESS, copies.shape))
    # Qhull splits a flat facet into triangles of one equation.
    return np.unique(hull.equations.round(6), axis=0)


def roof_over(points: NDArray[np.floating], plane: Plane, config: VisibleShapeConfig) -> Roof:
    """Heights of points (n, 3), metres, camera frame; gaps between neighbouring pixels' points are
    closed, and the roof juts out by one cell."""
    T_plane_cam = plane_frame(plane)
    placed = transform_points(T_plane_cam, points.astype(np.float64))
    cells = np.floor(placed[:, :2] / config.cell).astype(np.int64)
    border = config.closing
    first = cells.min(axis=0) - border
    heights = np.full(cells.max(axis=0) - first + 1 + border, -1.0)
    np.maximum.at(heights, tuple((cells - first).T), placed[:, 2])
    heights = grey_closing(maximum_filter(heights, size=3), size=config.closing)
    return Roof(T_plane_cam, config.cell, first, heights)
