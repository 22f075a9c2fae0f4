"""Alignment scores of many models at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from table_scene import T_CAM_WORLD, box, ell, placed, stored, verifier_of

from brrp_cli.config.retrieval import AlignmentConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.model import search_model
from brrp_cli.registration.quick_alignment import (
    Aligned,
    aligned,
    finely,
    first_placements,
)

CONFIG, FINEST = AlignmentConfig().search, AlignmentConfig().finest


@pytest.fixture(scope="module")
def models():
    return [search_model(stored(name)) for name in ("box", "ell")]


def scores(models, verifier):
    first = [first_placements(model, verifier, CONFIG) for model in models]
    return np.array([each.score for each in aligned(models, first, verifier, CONFIG)])


def test_the_true_model_scores_highest(models):
    where = placed(0.05, -0.04, 0.3)
    for true, mesh in enumerate((box(), ell())):
        score = scores(models, verifier_of(mesh, where))
        assert score[true] > 0.9 and score[1 - true] < score[true] - 0.1


def test_the_last_stage_brings_the_true_model_nearer(models):
    """Its placement was right to some millimetres; its score then comes from nearer still."""
    where = placed(0.05, -0.04, 0.3)
    verifier = verifier_of(box(), where)
    first = [first_placements(model, verifier, CONFIG) for model in models]
    before = aligned(models, first, verifier, CONFIG)
    after = finely(before[0], models[0], verifier, FINEST)

    def residual(found):
        T_model_cam = np.linalg.inv(found.T_cam_model[0])
        points = transform_points(T_model_cam, verifier.points)
        return np.abs(models[0].signed_distance(points)).mean()

    assert residual(after) <= residual(before[0]) + 1e-6
    assert residual(after) < 0.0005
    assert len(after.T_cam_model) == FINEST.fine
    other = finely(before[1], models[1], verifier, FINEST)
    assert after.score > other.score + 0.1


def test_an_object_that_leans_or_lies_on_others_is_aligned_too(models):
    """It stands in none of its resting poses on the table."""
    leaning = similarity(translation=np.array([0.05, -0.04, 0.06]))
    leaning[:3, :3] = Rotation.from_euler("xyz", [35, 20, 60], degrees=True).as_matrix()
    raised = similarity(translation=np.array([0.05, -0.04, 0.09]))
    for T_world_mesh in (leaning, raised):
        where = T_CAM_WORLD @ T_world_mesh
        score = scores(models, verifier_of(box(), where))
        assert score[0] > 0.85 and score[1] < score[0] - 0.2


def test_placements_keep_their_scores_when_something_else_orders_them():
    T = np.arange(4 * 16, dtype=np.float64).reshape(4, 4, 4)
    placed = Aligned(T, np.array([0.9, 0.8, 0.7, 0.6]))
    ordered = placed.first(3).ordered(placed.scores[:3] - np.array([0.3, 0.0, 0.0]))
    np.testing.assert_array_equal(ordered.scores, [0.8, 0.7, 0.9])
    np.testing.assert_array_equal(ordered.T_cam_model, T[[1, 2, 0]])
    assert ordered.score == 0.8
