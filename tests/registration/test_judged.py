"""Placements are judged where they fit best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import MESHES, TABLE, in_camera, photograph, placed, stored

from brrp_cli.config import HypothesesConfig
from brrp_cli.geometry import similarity
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.registration.likelihood import see
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.refined import refined
from brrp_cli.registration.verification import Verifier
from brrp_cli.registration.weigh import counted_once, judged

ID = 5
WHERE = (0.0, 0.0, 0.5)
CONFIG = HypothesesConfig()
SENSOR = CONFIG.sensor


@pytest.fixture(scope="module")
def frame():
    return photograph({ID: in_camera(MESHES["box"](), placed(*WHERE))})


def off(name, millimetres):
    """A placement of a stored object that is off the truth along the world's x."""
    model = search_model(stored(name))
    T = placed(*WHERE) @ similarity(translation=model.stored.center + [millimetres / 1000, 0, 0])
    return Hypothesis(model, T, 1.0, 0.9)


def judge(frame, placements, config=CONFIG):
    points = np.random.default_rng(0).permutation(frame.object_points(ID).astype(np.float64))
    verifier = Verifier(points, frame, TABLE)
    noise = pixel_noise(frame, TABLE, SENSOR)
    seen = see(frame, ID, TABLE, noise, SENSOR.patch, SENSOR.bleed, config.likelihood)
    refine = lambda each: refined(each, verifier, SENSOR.wave, config)  # noqa: E731
    return judged(placements, seen, config, refine)


def test_the_best_placement_of_an_object_is_judged_where_its_rays_end(frame):
    """One that is 1.5 mm off comes to what the true one has, to a tenth of a nat."""
    placements, (found,) = judge(frame, [off("box", 1.5)])
    _, (true,) = judge(frame, [off("box", 0.0)])
    assert found == pytest.approx(true, abs=0.1)
    np.testing.assert_allclose(
        placements[0].T_cam_model[:3, 3], off("box", 0.0).T_cam_model[:3, 3], atol=5e-4
    )


def test_the_other_placements_of_it_stay_as_they_are(frame):
    given = [off("box", 1.0), off("box", 4.0)]
    placements, ratios = judge(frame, given)
    assert placements[1] is given[1]
    assert ratios[0] > ratios[1]


def test_what_cannot_win_is_not_refined(frame):
    given = [off("box", 0.0), off("ball", 60.0)]
    placements, ratios = judge(frame, given)
    assert ratios[1] < CONFIG.likelihood.refined_from
    assert placements[1] is given[1]


@pytest.mark.parametrize("score", [0.24, 0.39])
def test_what_hardly_lies_on_what_is_seen_has_no_weight(frame, score):
    """Alone, or behind another one by more than `within`."""
    poor = replace(off("box", 0.0), alignment_score=score)
    given = [poor] if score < CONFIG.likelihood.least_alignment else [off("box", 0.0), poor]
    _, ratios = judge(frame, given)
    assert ratios[-1] == -np.inf
    _, (enough,) = judge(frame, [replace(poor, alignment_score=0.26)])
    assert enough > 0


def test_depth_counts_less_where_retrieval_knows_it():
    assert counted_once(CONFIG, False) is CONFIG
    known = counted_once(CONFIG, True).likelihood.depth
    assert known == CONFIG.likelihood.known_depth < CONFIG.likelihood.depth
