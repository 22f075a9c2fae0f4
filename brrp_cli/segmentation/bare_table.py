"""Where a table has no depth, as black or shiny ones have not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import TableConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import backproject
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
    least = config.lacking / (1 - config.lacking) * flat
    # Fewer than that lack depth anywhere: then nothing needs to be asked.
    if bare.sum() >= least:
        sight = backproject(np.ones(frame.shape), frame.K)[bare]
        bare[bare] = table.holds(table.plan(table.plane.met_by(sight)), 0.0)
    if bare.sum() < least:
        bare[:] = False
    return bare
