"""Pieces that lie beside what is recognised already: its own, and what is not its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from regroup_scene import taken_for
from scipy.ndimage import binary_dilation

from brrp_cli.api import reconstruct
from brrp_cli.config.mending import RegroupConfig
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.mending.regroup import regroup

BOX, PIECE = 1, 2
SMALL = SegmentConfig(regroup=replace(RegroupConfig(), least_pixels=100))


@pytest.fixture(scope="module")
def box(truth):
    return truth.segmap == 1


@pytest.fixture(scope="module")
def with_piece(truth, box, given):
    """Reconstructed: the box in one mask, and in another one what is `beside` it."""

    def reconstructed(beside):
        segmap = np.select([beside, box], [PIECE, BOX], 0)
        result = reconstruct(truth.with_masks(segmap), **given)
        assert taken_for(result) == {BOX: "red_box"}
        assert (beside & truth.valid).sum() >= SMALL.regroup.least_pixels
        return result

    return reconstructed


def test_a_piece_of_what_is_recognised_joins_it(with_piece, box, prior, again):
    columns = np.broadcast_to(np.arange(box.shape[1]), box.shape)
    result = regroup(
        with_piece(box & (columns > np.quantile(columns[box], 0.87))), prior, again, SMALL
    )
    assert taken_for(result) == {BOX: "red_box"}
    assert ((result.frame.segmap == BOX) == box).all()


def test_what_is_not_its_own_stays_apart(with_piece, box, prior, again):
    rows = np.arange(box.shape[0])[:, None]
    floor = binary_dilation(box, iterations=8) & ~box & (rows > np.median(np.nonzero(box)[0]))
    first = with_piece(floor)
    assert regroup(first, prior, again, SMALL) is first


def test_what_is_left_of_a_cut_mask_and_is_no_object_is_background(given, truth, prior, again):
    both = np.isin(truth.segmap, [2, 3])
    rows, columns = np.nonzero(both)
    blob = np.zeros_like(both)
    blob[rows.max() - 8 : rows.max() + 4, columns.max() - 2 : columns.max() + 14] = True
    blob &= truth.segmap == 0
    mask = both | blob
    result = regroup(
        reconstruct(truth.with_masks(np.where(mask, BOX, 0)), **given),
        prior,
        again,
        SegmentConfig(),
    )
    assert set(taken_for(result).values()) == {"red_can", "yellow_ball"}
    found = result.frame.segmap > 0
    assert found[both].mean() > 0.98 and found[blob].mean() < 0.3
