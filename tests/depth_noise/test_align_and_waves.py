import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from views import BOX, SHAPE, K, wall, wall_and_box

from brrp_cli.depth_noise.align import align_depth
from brrp_cli.depth_noise.waves import waves


@pytest.mark.parametrize("length", [1.0, 3.0, 20.0, (4.0, 30.0)])
def test_waves_have_unit_variance_and_the_correlation_that_is_asked_for(length):
    fields = np.stack([waves((200, 260), length, np.random.default_rng(s)) for s in range(30)])
    assert fields.std() == pytest.approx(1, rel=0.1)
    rows, columns = length if isinstance(length, tuple) else (length, length)
    for axis, lag in ((1, round(2 * rows)), (2, round(2 * columns))):
        beside = np.roll(fields, -lag, axis=axis)
        keep = (slice(None),) * axis + (slice(0, -lag),)
        correlation = (fields[keep] * beside[keep]).mean() / fields.var()
        assert correlation == pytest.approx(np.exp(-1), abs=0.12)


def test_alignment_without_offset_changes_nothing():
    depth = wall_and_box()
    assert align_depth(depth, K, 0.0, K, SHAPE) == pytest.approx(depth)


def test_alignment_moves_things_by_their_disparity_and_leaves_what_was_hidden_empty():
    offset = 0.05
    moved = align_depth(wall_and_box(), K, offset, K, SHAPE)
    near, far = K[0, 0] * offset / 0.7, K[0, 0] * offset / 0.9
    row = moved[120]
    box = np.flatnonzero(row == 0.7)
    assert box[0] == pytest.approx(BOX[1].start + near, abs=1)
    assert len(box) == pytest.approx(100, abs=1)
    # What the depth camera at the right cannot see of the wall lies left of the box for it, and
    # the colour camera finds nothing there.
    hidden = np.flatnonzero(row[60 : box[0]] == 0)
    assert len(hidden) == pytest.approx(near - far, abs=1.5)
    assert (row[box[-1] + 1 :] == 0.9).all()


def test_alignment_to_a_finer_image_leaves_no_cracks():
    fine = K.copy()
    fine[:2] *= 1.8
    found = align_depth(wall(), K, 0.0, fine, (430, 570))
    assert (found[5:-5, 5:-5] == 0.9).all()
