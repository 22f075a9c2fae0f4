"""Where a table has no depth, as black or shiny ones have not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import TableConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject
from brrp_cli.observation.support_plane import Plane
from brrp_cli.segmentation.table_plane import Table


def bare_pixels(
    frame: Frame,
    segmap: NDArray[np.integer],
    height: NDArray[np.floating],
    table: Table,
    config: TableConfig,
) -> NDArray[np.bool_]:
    """(H, W) pixels without depth where the table is in sight; none of a table that has depth in
    most places: there things hide what lacks it.

    segmap : (H, W), 0 = none; height : (H, W) metres above the table, NaN = no depth
    """
    free = segmap == BACKGROUND
    bare = free & ~frame.valid
    flat = int((free & (np.abs(height) < config.tolerance)).sum())
    # Fewer than that lack depth anywhere.
    if bare.sum() >= config.lacking / (1 - config.lacking) * flat:
        plan = table.plan(meets_plane(pixel_rays(frame.shape, frame.K)[bare], table.plane))
        bare[bare] = table.holds(plan, 0.0)
    if bare.sum() < config.lacking / (1 - config.lacking) * flat:
        bare[:] = False
    return bare


def pixel_rays(shape: tuple[int, int], K: NDArray[np.floating]) -> NDArray[np.float64]:
    """Directions (H, W, 3), with z = 1, in which pixels look."""
    return backproject(np.ones(shape), K).astype(np.float64)


def meets_plane(rays: NDArray[np.float64], plane: Plane) -> NDArray[np.float64]:
    """Points (..., 3), metres, camera frame, where rays (..., 3) meet a plane; NaN where they do
    not."""
    down = rays @ plane.normal
    far = np.where(down < 0, -plane.offset / np.where(down < 0, down, -1.0), np.nan)
    return np.asarray(rays * far[..., None])
