"""Insides join their outsides, and nothing else does."""

from dataclasses import replace

import numpy as np
import trimesh
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.config.segmentation import FootprintsConfig, SegmentConfig
from brrp_cli.segmentation.join_insides import join_insides
from brrp_cli.segmentation.seen_surfaces import see_surfaces
from brrp_cli.shapes import solids

CONFIG = FootprintsConfig()


def joined(frame, moved=None, config=CONFIG):
    """The masks of a frame as parts that were joined. moved : pixels (n, 2) of them whose depth is
    that of something half a metre away on the table"""
    seen = see_surfaces(frame, 0, SegmentConfig())
    parts, plan = np.where(seen.valid, frame.segmap, 0), seen.plan.copy()
    if moved is not None:
        plan[tuple(moved.T)] -= [0.5, 0.0]
    return join_insides(parts, plan, seen.height, seen.table.plan(seen.normals), config)


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


def test_a_few_bled_pixels_change_nothing():
    frame = photograph(mug())
    inside = np.argwhere(frame.segmap == 2)
    bled = inside[:: len(inside) // 5]
    assert np.unique(joined(frame, bled)).tolist() == [0, 1]
    taken = replace(CONFIG, bled=0.0)
    assert np.unique(joined(frame, bled, taken)).tolist() == [0, 1, 2]


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
