"""Where a table has no depth, as black or shiny ones have not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import TableConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject
from brrp_cli.segmentation.table_plane import Table


def bare_pixels(
    frame: Frame, segmap: NDArray[np.integer], table: Table, config: TableConfig
) -> NDArray[np.bool_]:
    """(H, W) pixels without depth where the table is in sight; none of a table that has depth in
    most places: there things hide what lacks it.

    segmap : (H, W), 0 = none
    """
    sight = backproject(np.ones(frame.shape), frame.K).reshape(-1, 3).astype(np.float64)
    down = sight @ table.plane.normal
    meets = (down < 0) & (segmap == BACKGROUND).ravel()
    at = sight[meets] * (-table.plane.offset / down[meets])[:, None]
    meets[meets] = table.holds(table.plan(at), 0.0)
    bare = meets.reshape(frame.shape) & ~frame.valid
    if bare.sum() < config.lacking * meets.sum():
        return np.zeros(frame.shape, dtype=bool)
    return bare
