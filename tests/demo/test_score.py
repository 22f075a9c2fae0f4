"""Scores of reconstructions that are known to be right, shifted or missing."""

import math

import pytest

from brrp_cli.demo.score import score
from brrp_cli.shapes import solids


def test_the_truth_itself_scores_one():
    box = solids.box(0.1, 0.08, 0.2)
    found = score(box, box, seed=0)
    assert found.iou == 1.0
    # Two random samples of one surface are this far apart: about the spacing of 8,000 points.
    assert found.chamfer < 0.004


def test_a_ball_too_large_scores_the_ratio_of_volumes_and_twice_the_gap():
    small, large = solids.ball(0.06), solids.moved(solids.ball(0.07), z=-0.01)
    found = score(large, small, seed=0)
    assert found.iou == pytest.approx((6 / 7) ** 3, abs=0.02)
    assert found.chamfer == pytest.approx(0.02, abs=0.001)


def test_nothing_scores_zero_and_has_no_distance():
    found = score(None, solids.box(0.1, 0.1, 0.1), seed=0)
    assert found.iou == 0.0
    assert math.isnan(found.chamfer)
