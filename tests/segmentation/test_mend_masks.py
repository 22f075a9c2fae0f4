"""Masks mended by boxes whose place is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from table_scene import SHAPE, T_CAM_WORLD, TABLE, K, in_camera, photograph

from brrp_cli.config.mending import MendConfig
from brrp_cli.raycast import look
from brrp_cli.segmentation.mend_masks import Placed, mend_masks
from brrp_cli.shapes import solids

BOX = in_camera(solids.box(0.12, 0.10, 0.10), T_CAM_WORLD)
OTHER = in_camera(solids.moved(solids.box(0.08, 0.08, 0.06), x=0.18, y=0.05), T_CAM_WORLD)
ON_TOP = in_camera(solids.moved(solids.box(0.07, 0.07, 0.08), z=0.10), T_CAM_WORLD)


def seen(*meshes):
    """A frame with ids 1, 2, ..., and each mesh as it alone is seen."""
    frame = photograph(dict(enumerate(meshes, start=1)))
    return frame, [look([mesh], K, SHAPE).depth for mesh in meshes]


def mended(segmap, frame, placed, config=None, first_free=1, fixed=()):
    noise = np.random.default_rng(0).normal(0, 0.001, SHAPE)
    depth = frame.points[..., 2] + noise
    height = TABLE.signed_distance(frame.points)
    config, tolerance = config or MendConfig(), np.full(SHAPE, 0.008)
    return mend_masks(segmap, depth, placed, height, tolerance, config, first_free, fixed)


def in_three(mask, ids):
    """The mask in three pieces, side by side."""
    columns = np.nonzero(mask.any(axis=0))[0]
    cuts = np.linspace(columns[0], columns[-1] + 1, 4).astype(int)
    pieces = np.zeros(SHAPE, np.int64)
    for i, left, right in zip(ids, cuts[:-1], cuts[1:], strict=True):
        pieces[:, left:right][mask[:, left:right]] = i
    return pieces


def test_one_box_in_three_pieces_is_one_again():
    frame, (box, _) = seen(BOX, OTHER)
    pieces = in_three(frame.segmap == 1, (3, 4, 5)) + np.where(frame.segmap == 2, 2, 0)
    result = mended(pieces, frame, [Placed(4, 0.9, box)])
    assert np.array_equal(result.segmap == 4, frame.segmap == 1)
    assert np.array_equal(result.segmap == 2, frame.segmap == 2)
    assert result.changed == (4,)


def test_a_piece_that_is_fixed_is_not_taken_over():
    frame, (box,) = seen(BOX)
    pieces = in_three(frame.segmap == 1, (3, 4, 5))
    result = mended(pieces, frame, [Placed(4, 0.9, box)], fixed={5})
    assert np.array_equal(result.segmap, np.where(pieces == 3, 4, pieces))


def test_pieces_that_were_all_recognised_become_one():
    frame, (box,) = seen(BOX)
    pieces = in_three(frame.segmap == 1, (1, 2, 3))
    result = mended(pieces, frame, [Placed(i, 0.9, box) for i in (1, 2, 3)])
    assert len(np.unique(result.segmap)) == 2
    assert np.array_equal(result.segmap > 0, frame.segmap > 0)


def test_pixels_of_the_table_are_given_back():
    frame, (box,) = seen(BOX)
    rows, columns = np.nonzero(frame.segmap == 1)
    taken = frame.segmap.copy()
    taken[rows.max() - 20 : rows.max() + 1, columns.min() - 40 : columns.max()] = 1
    assert (taken == 1).sum() > 1.2 * (frame.segmap == 1).sum()
    result = mended(taken, frame, [Placed(1, 0.9, box)])
    wrong = (result.segmap == 1) ^ (frame.segmap == 1)
    # Within the few pixels by which a silhouette may be off.
    assert wrong.sum() < 0.3 * ((taken == 1) & (frame.segmap == 0)).sum()
    assert result.segmap.max() == 1


def test_what_stands_on_a_recognised_thing_becomes_an_object():
    frame, (box, _) = seen(BOX, ON_TOP)
    one = np.where(frame.segmap > 0, 1, 0)
    result = mended(one, frame, [Placed(1, 0.9, box)])
    assert len(result.changed) == 2
    new = max(result.changed)
    truth = frame.segmap == 2
    assert ((result.segmap == new) & truth).sum() > 0.8 * truth.sum()
    assert ((result.segmap == new) & ~truth).sum() < 0.05 * truth.sum()
    assert max(mended(one, frame, [Placed(1, 0.9, box)], first_free=40).changed) == 40


def test_what_two_explain_goes_to_the_one_that_explains_it():
    frame, (box, top) = seen(BOX, ON_TOP)
    rows = np.nonzero(frame.segmap == 2)[0]
    mixed = frame.segmap.copy()
    lower_half = (frame.segmap == 2) & (np.arange(SHAPE[0])[:, None] > np.median(rows))
    mixed[lower_half] = 1
    result = mended(mixed, frame, [Placed(1, 0.95, box), Placed(2, 0.9, top)])
    assert ((result.segmap == 2) & lower_half).sum() > 0.8 * lower_half.sum()
    assert result.segmap.max() == 2


def test_masks_that_are_right_stay_and_doubtful_placements_change_nothing():
    frame, (box, other) = seen(BOX, OTHER)
    right = [Placed(1, 0.9, box), Placed(2, 0.9, other)]
    assert mended(frame.segmap, frame, right).segmap is frame.segmap
    pieces = in_three(frame.segmap == 1, (1, 3, 4))
    assert mended(pieces, frame, [Placed(3, 0.6, box)]).changed == ()
    # A placement that does not explain its own mask is not trusted, whatever it weighs.
    beside = np.roll(box, 90, axis=1)
    assert mended(pieces, frame, [Placed(3, 0.9, beside)]).changed == ()
    trusting = replace(MendConfig(), least_weight=0.5)
    assert mended(pieces, frame, [Placed(3, 0.6, box)], trusting).changed == (3,)
