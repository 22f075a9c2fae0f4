"""What placements tell of the stored objects that were tried."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import placed, stored

from brrp_cli.geometry import similarity
from brrp_cli.methods.placements import Placements
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis

STANDING, ASIDE = placed(0.02, -0.03, 0.5), placed(0.1, 0, 0)
TO_MIDDLE = similarity(translation=np.array([0, 0, 0.07]))


def hypothesis(name, T_cam_mesh, score):
    return Hypothesis(search_model(stored(name)), T_cam_mesh @ TO_MIDDLE, 1.0, score)


@pytest.fixture
def found():
    """Two placements of the box, none of the ball, one of the fruit."""
    boxes = [hypothesis("box", STANDING, 0.9), hypothesis("box", ASIDE, 0.6)]
    fruit = hypothesis("fruit", placed(-0.1, 0, 0), 0.5)
    return Placements(
        chosen=[("box", 0.6), ("ball", 0.2), ("fruit", 0.1)],
        counts=[2, 0, 1],
        placed=[*boxes, fruit],
        alone=[3.0, -1.0, 2.0],
        weights=np.array([0.5, 0.1, 0.15, 0.25]),
    )


def test_an_object_has_the_weight_of_all_of_its_placements(found):
    assert [each.weight for each in found.retrieved()] == pytest.approx([0.6, 0.0, 0.15])
    assert found.heaviest == pytest.approx(0.6) and found.unknown == 0.25


@pytest.mark.parametrize("first, second", [(0.5, 0.1), (0.1, 0.5), (0.3, 0.3)])
def test_an_object_lies_where_its_heaviest_placement_is(found, first, second):
    """As its mesh does; the alignment score does not decide."""
    weights = np.array([first, second, 0.15, 0.25])
    box, ball, _ = replace(found, weights=weights).retrieved()
    score, where = (0.9, STANDING) if first >= second else (0.6, ASIDE)
    assert (box.name, box.probability, box.alignment_score) == ("box", 0.6, score)
    np.testing.assert_allclose(box.T_cam_mesh, where, atol=1e-6)
    assert ball.T_cam_object is None and ball.T_cam_mesh is None


def test_turns_that_are_as_probable_are_those_of_the_heaviest_placement(found):
    half_turn = STANDING @ TO_MIDDLE @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    told = replace(found, alike={0: half_turn[None], 1: np.stack([ASIDE, ASIDE])})
    box, _, fruit = told.retrieved()
    (alike,) = box.alike
    turned = STANDING @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    np.testing.assert_allclose(alike, turned, atol=1e-6)
    assert fruit.alike == ()


def test_of_an_object_the_best_ratio_counts(found):
    assert found.ratios() == {"box": 3.0, "fruit": 2.0}


def test_nothing_was_tried():
    none = Placements([], [], [], [], np.array([1.0]))
    assert none.heaviest == 0 and none.unknown == 1 and none.retrieved() == []
