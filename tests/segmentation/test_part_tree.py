"""Joins that nearly were made, and some that nearly were not."""

import numpy as np

from brrp_cli.segmentation.agglomerate import Join
from brrp_cli.segmentation.part_objects import Parted
from brrp_cli.segmentation.part_tree import nearly_apart, nearly_joined, parts_of

# Stripes 1 to 5: 1, 2 and 3 became mask 7, 4 mask 8 and 5 mask 9.
PARTS = np.repeat([[1] * 10 + [2] * 10 + [3] * 10 + [4] * 10 + [5] * 10], 12, axis=0)
JOINS = [Join(2, 3, 0.9), Join(1, 2, 0.6), Join(4, 5, 0.4), Join(1, 4, 0.2)]
PARTED = Parted(PARTS, np.zeros(PARTS.shape), JOINS)
SEGMAP = np.select([PARTS <= 3, PARTS == 4], [7, 8], 9)


def test_masks_that_a_join_would_bring_together_come_with_the_likeliest_first():
    assert nearly_joined(PARTED, SEGMAP, [7, 8, 9]) == [{8, 9}, {7, 8, 9}]
    assert nearly_joined(PARTED, SEGMAP, [8, 9]) == [{8, 9}]
    assert nearly_joined(PARTED, SEGMAP, [7, 8]) == []


def test_sides_of_the_last_joins_inside_a_mask_are_parts_of_it():
    found = nearly_apart(PARTED, SEGMAP, 7, 5)
    assert [np.unique(PARTS[mask]).tolist() for mask in found] == [[1], [2, 3], [2], [3]]
    assert len(nearly_apart(PARTED, SEGMAP, 7, 1)) == 2
    assert nearly_apart(PARTED, SEGMAP, 9, 5) == []


def test_pixels_of_a_mask_in_no_part_go_to_the_nearest():
    grown = np.pad(SEGMAP, ((0, 3), (0, 0)), mode="edge")
    parted = Parted(np.pad(PARTS, ((0, 3), (0, 0))), np.zeros(grown.shape), JOINS)
    first, second = nearly_apart(parted, grown, 7, 1)
    assert np.array_equal(first | second, grown == 7) and not (first & second).any()


def test_what_another_mask_holds_does_not_hide_the_joins_within_one():
    # 4 took in 3 before, but is of another mask.
    joins = [Join(4, 3, 0.9), Join(4, 2, 0.7), Join(1, 4, 0.6)]
    found = nearly_apart(Parted(PARTS, np.zeros(PARTS.shape), joins), SEGMAP, 7, 5)
    assert [np.unique(PARTS[mask]).tolist() for mask in found] == [[1], [2, 3], [3], [2]]


def test_without_a_table_there_are_no_parts(scene):
    from brrp_cli.config.segmentation import SegmentConfig
    from brrp_cli.frames.build import make_frame

    clutter = np.random.default_rng(0).uniform(0.5, 5, scene.depth.shape)
    assert parts_of(make_frame(depth=clutter, K=scene.K), 0, SegmentConfig()) is None
