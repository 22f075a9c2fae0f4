"""From hypotheses that were placed to the mean functions of what may be there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from table_scene import placed, stored

from brrp_cli.config import FittedMapConfig, HypothesesConfig
from brrp_cli.geometry import similarity
from brrp_cli.methods.brrp_default import _kept
from brrp_cli.methods.infer_object import placed_shape
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis

CONFIG = HypothesesConfig()
MEAN = CONFIG.mean
T = placed(0.02, -0.03, 0.5) @ similarity(translation=np.array([0, 0, 0.07]))


def hypothesis(score, size=1.0):
    return Hypothesis(search_model(stored("box")), T @ similarity(size), size, score)


def shape_at(score, size=1.0):
    """Seen from all sides by a sensor with waves of half a millimetre."""
    one = hypothesis(score, size)
    seen = one.model.surface @ one.T_cam_model[:3, :3].T + one.T_cam_model[:3, 3]
    return placed_shape(one, seen.astype(np.float32), 0.0005, CONFIG)


@pytest.mark.parametrize("size", [1.0, 0.8])
def test_a_placed_shape_lies_where_the_hypothesis_puts_the_model(size):
    shape = shape_at(0.95, size)
    assert shape.name == "box" and shape.unit == pytest.approx(0.07 * size, rel=1e-5)
    local = np.linalg.inv(T)
    vertices = shape.vertices @ local[:3, :3].T + local[:3, 3]
    np.testing.assert_allclose(
        np.abs(vertices).max(axis=0), size * np.array([0.05, 0.03, 0.07]), atol=1e-6
    )
    middle, outside = T[:3, 3], T[:3, 3] + 0.2
    np.testing.assert_allclose(shape.logits(np.stack([middle, outside])), [MEAN.limit, -MEAN.limit])


def test_less_evidence_makes_a_softer_surface():
    widths = [shape_at(score).width for score in (0.85, 0.6, 0.2, -1.0)]
    for sharp, soft in pairwise(widths):
        assert sharp < soft
    sure = shape_at(MEAN.sure).width
    assert sure >= MEAN.width and shape_at(1.0).width == sure
    # Half a unit below `sure` adds half of `doubt`.
    assert shape_at(MEAN.sure - 0.5).width == pytest.approx(sure + MEAN.doubt / 2)


def test_hypotheses_that_weigh_next_to_nothing_are_left_out():
    config = FittedMapConfig()
    weights = np.array([0.005, 0.5, 0.3, 0.001, 0.194])
    np.testing.assert_array_equal(_kept(weights, config), [1, 2, 4])
    # As many as there are particles, the heaviest of them, in their order.
    many = np.append(np.full(12, 0.07), 0.16)
    np.testing.assert_array_equal(_kept(many, config), [0, 1, 2, 3, 4, 5, 6, 12])
    # One at least.
    np.testing.assert_array_equal(_kept(np.full(200, 1 / 200), config), [0])
