"""What is seen from above shows where an object ends along the plane that it stands on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing, maximum_filter

from brrp_cli.config import CompletionConfig
from brrp_cli.geometry import transform_points
from brrp_cli.observation.support_plane import Plane, plane_frame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeightMap:
    """The greatest observed height over each cell of the plane, -1 where nothing was seen.

    T_plane_cam : (4, 4); first : (2,) index of the first cell; heights : (a, b), metres
    """

    T_plane_cam: Array
    cell: float
    first: NDArray[np.int64]
    heights: Array

    def above(self, points: Array) -> Array:
        """Height (n,) of points (n, 3), metres, camera frame, over the map; negative
        under it."""
        # The axis comes first: long contiguous rows are what NumPy is fast on.
        x, y, z = self.T_plane_cam[:3, :3] @ points.T + self.T_plane_cam[:3, 3:]
        row, column = (
            np.floor(along / self.cell).astype(np.int64) - first
            for along, first in zip((x, y), self.first, strict=True)
        )
        rows, columns = self.heights.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        number = np.where(inside, row * columns + column, 0)
        return np.asarray(z - np.where(inside, self.heights.ravel()[number], -1.0))


def height_map_over(
    points: NDArray[np.floating], plane: Plane, config: CompletionConfig
) -> HeightMap:
    """Heights of points (n, 3), metres, camera frame; gaps between neighbouring pixels' points are
    closed, and the map juts out by one cell."""
    T_plane_cam = plane_frame(plane)
    placed = transform_points(T_plane_cam, points.astype(np.float64))
    cells = np.floor(placed[:, :2] / config.cell).astype(np.int64)
    border = config.closing
    first = cells.min(axis=0) - border
    heights = np.full(cells.max(axis=0) - first + 1 + border, -1.0)
    np.maximum.at(heights, tuple((cells - first).T), placed[:, 2])
    heights = grey_closing(maximum_filter(heights, size=3), size=config.closing)
    return HeightMap(T_plane_cam, config.cell, first, heights)
