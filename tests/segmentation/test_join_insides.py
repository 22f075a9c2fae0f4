"""Insides join their outsides, and nothing else does."""

import numpy as np
import trimesh
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.config.segmentation import FootprintsConfig, SegmentConfig
from brrp_cli.segmentation.join_insides import join_insides
from brrp_cli.segmentation.seen_surfaces import see_surfaces
from brrp_cli.shapes import solids


def joined(frame):
    seen = see_surfaces(frame, 0, SegmentConfig())
    parts = np.where(seen.valid, frame.segmap, 0)
    plan_normals = seen.table.plan(seen.normals)
    return join_insides(parts, seen.plan, seen.height, plan_normals, FootprintsConfig())


def mug():
    """The outside of a mug as 1 and its inside as 2."""
    high, outer, inner = 0.1, 0.05, 0.046
    up = np.linspace([0, 0, 0], [0, 0, high], 2)
    outside = trimesh.creation.annulus(inner + 0.002, outer, segment=up, sections=64)
    inside = trimesh.creation.annulus(inner, inner + 0.002, segment=up, sections=64)
    return {1: in_camera(outside, T_CAM_WORLD), 2: in_camera(inside, T_CAM_WORLD)}


def test_the_inside_of_a_mug_is_the_mugs():
    frame = photograph(mug())
    assert (frame.segmap == 1).sum() > 500 and (frame.segmap == 2).sum() > 500
    found = joined(frame)
    assert np.unique(found).tolist() == [0, 1]


def test_bled_pixels_far_behind_change_nothing():
    frame = photograph(mug())
    rows, columns = np.nonzero(frame.segmap == 0)
    behind = np.argsort(rows)[:5]
    segmap = frame.segmap.copy()
    segmap[rows[behind], columns[behind]] = 2
    found = joined(frame.with_masks(segmap))
    assert np.unique(found).tolist() == [0, 1]


def test_a_can_behind_a_can_is_another():
    can = trimesh.creation.cylinder(0.035, 0.1, sections=64).apply_translation([0, 0, 0.05])
    box = solids.moved(solids.box(0.06, 0.06, 0.1), y=0.0)
    for thing in (can, box):
        for apart in ((0.075, 0.0), (0.0, 0.075), (0.06, 0.05)):
            first = thing.copy().apply_translation([-apart[0] / 2, -apart[1] / 2, 0])
            second = thing.copy().apply_translation([apart[0] / 2, apart[1] / 2, 0])
            frame = photograph(
                {1: in_camera(first, T_CAM_WORLD), 2: in_camera(second, T_CAM_WORLD)}
            )
            assert np.unique(joined(frame)).tolist() == [0, 1, 2], apart
