"""Where a table goes on beyond the image, and what stands there."""

from __future__ import annotations

import numpy as np

from brrp_cli.config.table import TableConfig
from brrp_cli.hulls import beyond_hull
from brrp_cli.segmentation.beyond_image import beyond_image

CONFIG = TableConfig()
CELL = 0.01  # metres from one pixel to the next


def table(height=60, width=80):
    """A table that is seen from above: plan (H, W, 2)."""
    rows, columns = np.mgrid[:height, :width]
    return CELL * np.stack([columns, rows], axis=-1).astype(np.float64)


def beside(hull, *plan):
    return beyond_hull(hull, np.array([plan]))[0]


def test_a_table_that_fills_the_image_goes_on_beyond_each_border():
    plan = table()
    hull = beyond_image(plan, np.ones(plan.shape[:2], np.bool_), CONFIG)
    assert hull is not None
    for x, y in ((0.02, 0.3), (0.77, 0.3), (0.4, 0.02), (0.4, 0.57)):
        out = np.sign([x - 0.4, y - 0.3]) * (np.abs([x - 0.4, y - 0.3]) > 0.2)
        assert beside(hull, *(np.array([x, y]) + (CONFIG.beyond - 0.005) * out)) < 0
        assert beside(hull, *(np.array([x, y]) + (CONFIG.beyond + 0.005) * out)) > 0


def test_it_goes_on_beyond_the_blind_side_of_a_stereo_camera():
    plan = table()
    plan[:, :10] = np.nan
    hull = beyond_image(plan, np.isfinite(plan[..., 0]), CONFIG)
    assert hull is not None and beside(hull, 0.0, 0.3) < 0
    plan[:, :20] = np.nan
    hull = beyond_image(plan, np.isfinite(plan[..., 0]), CONFIG)
    assert hull is not None and beside(hull, 0.05, 0.3) > 0


def test_a_table_that_ends_within_the_image_goes_nowhere():
    plan = table()
    flat = np.zeros(plan.shape[:2], np.bool_)
    flat[20:40, 20:60] = True
    assert beyond_image(plan, flat, CONFIG) is None
    # Where it reaches one border, it goes on there alone.
    flat[20:, 20:60] = True
    hull = beyond_image(plan, flat, CONFIG)
    assert hull is not None
    assert beside(hull, 0.4, 0.7) < 0
    assert beside(hull, 0.1, 0.5) > 0 and beside(hull, 0.4, 0.4) > 0


def test_an_image_too_small_to_tell_has_no_beyond():
    def of(side):
        return beyond_image(table(side, side), np.ones((side, side), np.bool_), CONFIG)

    small = CONFIG.step + CONFIG.edge
    assert of(1) is None and of(small) is None
    assert of(small + 1) is not None
