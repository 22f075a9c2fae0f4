"""Where a camera mixes the depths of both sides of an outline is found, and left out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, uniform_filter
from table_scene import in_camera, photograph, placed

from brrp_cli.config import MixedEdgesConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.mixed_edges import mixing_width, without_mixed
from brrp_cli.shapes import solids

CONFIG = MixedEdgesConfig()
BOX, ROD = 1, 2


def seen() -> Frame:
    """A tall box, whose sides and top stand before the table far behind them."""
    return photograph({BOX: in_camera(solids.box(0.1, 0.06, 0.14), placed(-0.05, 0.0, 0.4))})


def mixed(frame: Frame, width: int) -> Frame:
    """As a camera measures it that takes the mean of all depths within `width` pixels."""
    depth = frame.depth.astype(np.float64)
    mean = uniform_filter(np.nan_to_num(depth, nan=float(np.nanmax(depth))), 2 * width + 1)
    return frame.with_points((frame.points * (mean / depth)[..., None]).astype(np.float32))


@pytest.mark.parametrize("width", [1, 2])
def test_the_width_is_that_of_the_camera(width):
    assert mixing_width(mixed(seen(), width), CONFIG) == width


def test_a_camera_that_mixes_nothing_has_no_width():
    frame = seen()
    assert mixing_width(frame, CONFIG) == 0
    assert without_mixed(frame, 0, CONFIG, [BOX]) is frame


def test_outlines_at_jumps_have_no_depth_and_those_on_the_table_keep_it():
    frame = seen()
    found = without_mixed(frame, 2, CONFIG, frame.object_ids)
    gone = frame.valid & ~found.valid
    kept = ~np.isnan(found.points)
    np.testing.assert_array_equal(found.points[kept], frame.points[kept])
    own = frame.segmap == BOX
    assert not gone[~own].any()
    within = distance_transform_edt(own)
    assert within[gone].max() < 3
    top = np.nonzero(own.any(axis=1))[0][0]
    assert gone[top : top + 2][own[top : top + 2]].mean() > 0.8
    foot = np.nonzero(own.any(axis=1))[0][-1]
    assert not gone[foot - 1 : foot + 1].any()


def test_what_is_thin_is_kept():
    """A rod that stands beside the box, as a handle would."""
    rod = in_camera(solids.box(0.005, 0.005, 0.14), placed(0.06, 0.0, 0.3))
    box = in_camera(solids.box(0.1, 0.06, 0.14), placed(-0.05, 0.0, 0.4))
    frame = photograph({BOX: box, ROD: rod})
    segmap = np.where(frame.segmap == ROD, BOX, frame.segmap)
    found = without_mixed(frame.with_masks(segmap), 2, CONFIG, [BOX])
    thin = frame.segmap == ROD
    np.testing.assert_array_equal(found.valid[thin], frame.valid[thin])
    assert np.count_nonzero(found.valid) < np.count_nonzero(frame.valid)


def test_of_one_object_alone():
    box = in_camera(solids.box(0.06, 0.06, 0.14), placed(-0.08, 0.0, 0.3))
    other = in_camera(solids.box(0.06, 0.06, 0.14), placed(0.08, 0.0, 0.3))
    frame = photograph({1: box, 2: other})
    both, one = (
        without_mixed(frame, 2, CONFIG, frame.object_ids),
        without_mixed(frame, 2, CONFIG, [2]),
    )
    np.testing.assert_array_equal(one.object_points(2), both.object_points(2))
    np.testing.assert_array_equal(one.object_points(1), frame.object_points(1))
    assert len(both.object_points(1)) < len(frame.object_points(1))
