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
    frame: Frame, segmap: NDArray[np.integer], table: Table, config: TableConfig
) -> NDArray[np.bool_]:
    """(H, W) pixels without depth where the table is in sight; none of a table that has depth in
    most places: there things hide what lacks it.

    segmap : (H, W), 0 = none
    """
    plan = table.plan(meets_plane(frame.shape, frame.K, table.plane))
    over = (segmap == BACKGROUND) & (table.beside(plan) <= 0)
    bare = over & ~frame.valid
    if bare.sum() < config.lacking * over.sum():
        return np.zeros(frame.shape, dtype=bool)
    return bare


def meets_plane(
    shape: tuple[int, int], K: NDArray[np.floating], plane: Plane
) -> NDArray[np.float64]:
    """Points (H, W, 3), metres, camera frame, where the sight of each pixel meets a plane; NaN
    where it does not."""
    sight = backproject(np.ones(shape), K).astype(np.float64)
    down = sight @ plane.normal
    far = np.where(down < 0, -plane.offset / np.where(down < 0, down, -1.0), np.nan)
    return sight * far[..., None]
