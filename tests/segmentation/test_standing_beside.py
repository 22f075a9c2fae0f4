"""How far a table goes on where it has no depth."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from room_scene import TABLE, THINGS, photograph, turned

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.segmentation.bare_table import bare_pixels
from brrp_cli.segmentation.seen_table import see_table
from brrp_cli.segmentation.segment import segment
from brrp_cli.shapes import solids

CONFIG = SegmentConfig()
ELEVATION, DISTANCE = 0.5, 0.7


def without_depth(frame: Frame, lacking: np.ndarray) -> Frame:
    depth = np.where(lacking | ~frame.valid, 0.0, frame.depth)
    return make_frame(
        rgb=frame.rgb, depth=depth, K=frame.K, segmap=frame.segmap, T_world_cam=frame.T_world_cam
    )


def bare(frame: Frame) -> Frame:
    """The frame of a table that has depth in the lower sixth of the image alone."""
    far = np.arange(frame.shape[0])[:, None] < 5 * frame.shape[0] // 6
    return without_depth(frame, far & (frame.segmap == 0))


def beside(frame: Frame, object_id: int) -> float:
    """Metres that the middle of an object lies beside the table, as it is seen without its mask."""
    seen = see_table(frame.points, frame.K, 0, None, CONFIG)
    return float(np.nanmedian(seen.beside[frame.segmap == object_id]))


def bare_of(frame: Frame, table) -> np.ndarray:
    return bare_pixels(frame, frame.segmap, table.height(frame.points), table, CONFIG.table)


def test_things_on_a_bare_table_are_found():
    whole = photograph(THINGS, [TABLE], elevation=ELEVATION, distance=DISTANCE)
    frame = bare(whole)
    masks = segment(frame)
    assert masks.max() == len(THINGS)
    for object_id in frame.object_ids:
        assert beside(frame, object_id) < 0
        mine = frame.segmap == object_id
        assert (masks[mine] > 0).mean() > 0.9


@pytest.mark.parametrize(("floor", "stands"), [(0.0, True), (-0.3, False)])
def test_what_reaches_below_the_table_does_not_stand_on_it(floor, stands):
    """The table ends 15 cm before a box; of what the box stands on there is no depth."""
    end = turned(trimesh.creation.box((1.0, 3.0, 0.02)).apply_translation([0.65, 0.0, -0.01]))
    box = turned(solids.moved(solids.box(0.1, 0.2, 0.15 - floor), x=-0.05, z=floor))
    frame = photograph([box], [end], elevation=ELEVATION, distance=DISTANCE)
    assert (beside(frame, 1) < 0) == stands


def test_what_stands_on_another_table_is_no_part_of_this_one():
    """Between them a floor is seen."""
    floor = trimesh.creation.box((6.0, 6.0, 0.02)).apply_translation([0.0, 0.0, -0.7])
    end = turned(trimesh.creation.box((1.0, 3.0, 0.02)).apply_translation([0.65, 0.0, -0.01]))
    box = turned(solids.moved(solids.box(0.1, 0.2, 0.15), x=-0.05))
    frame = photograph([box], [end, floor], elevation=ELEVATION, distance=DISTANCE)
    assert beside(frame, 1) > 0


def test_a_table_lacks_depth_where_it_is_bare():
    whole = photograph(THINGS, [TABLE], elevation=ELEVATION, distance=DISTANCE)
    table = see_table(whole.points, whole.K, 0, None, CONFIG).table
    assert not bare_of(whole, table).any()
    frame = bare(whole)
    found = bare_of(frame, table)
    lacking = ~frame.valid & (frame.segmap == 0)
    on_table = table.beside(table.plan(whole.points)) <= 0
    assert (found ^ (lacking & on_table)).sum() < 0.01 * lacking.sum()
    # Where a thing hides a little of it, it is not bare.
    hidden = np.zeros(whole.shape, bool)
    hidden[100:120] = True
    little = without_depth(whole, hidden & (whole.segmap == 0))
    assert not bare_of(little, table).any()
