"""A search that allows for what a camera's depth errs by over whole patches."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import TABLE, box, in_camera, photograph, placed, stored

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import similarity
from brrp_cli.registration.model import search_model
from brrp_cli.registration.verification import Verifier, in_waves

BOX = 5
CONFIG = SearchConfig()
FINE = CONFIG.alignment_score


def test_a_camera_that_errs_by_less_than_is_allowed_changes_nothing():
    assert in_waves(CONFIG, 0.0) == CONFIG
    assert in_waves(CONFIG, FINE.tolerance / CONFIG.waves) == CONFIG


@pytest.mark.parametrize("wave", [0.0018, 0.005])
def test_what_is_near_and_what_is_free_begin_at_so_many_deviations(wave):
    found = in_waves(CONFIG, wave).alignment_score
    deviation = CONFIG.waves * wave
    assert found.tolerance == pytest.approx(max(deviation, FINE.tolerance))
    assert found.near == pytest.approx(max(deviation, FINE.near))
    assert found.far / found.near == pytest.approx(FINE.far / FINE.near)
    assert found.contradiction == FINE.contradiction


def test_where_all_depth_is_too_far_the_true_placement_still_scores_well():
    pose = placed(0.02, -0.03, 0.5)
    frame = photograph({BOX: in_camera(box(), pose)})
    # The whole patch that holds the box is 8 mm too far: two deviations of waves of 4 mm.
    away = np.linalg.norm(frame.points, axis=-1, keepdims=True)
    frame = frame.with_points((frame.points * (1 + 0.008 / away)).astype(np.float32))
    points = np.random.default_rng(0).permutation(frame.object_points(BOX)).astype(np.float64)
    verifier, model = Verifier(points, frame, TABLE), search_model(stored("box"))
    truth = (pose @ similarity(translation=np.array([0, 0, 0.07])))[None]

    def score(config):
        return verifier.score(
            truth, model, config.alignment_score, model_points=1000, seen_points=1000
        )[0]

    assert score(CONFIG) < 0.2
    assert score(in_waves(CONFIG, 0.004)) > score(CONFIG) + 0.3
