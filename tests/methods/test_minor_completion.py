"""What hardly can be is completed on fewer nodes: the same shape, coarser."""

from __future__ import annotations

import numpy as np
import pytest
from table_scene import MESHES, in_camera, photograph, placed, stored

from brrp_cli.completion.seen_surface import seen_surface
from brrp_cli.config import HypothesesConfig, ObservationConfig
from brrp_cli.geometry import similarity
from brrp_cli.inference.mean_grid import MeanGrid
from brrp_cli.methods.earlier_views import ALONE
from brrp_cli.methods.infer_object import infer_object, placed_shape, shown_of
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.observation.ray_samples import observe
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis

ID = 3
CONFIG = HypothesesConfig()


@pytest.fixture(scope="module")
def completed():
    """Weight of the completion -> its mean, beside a placement of the box that is seen."""
    model = search_model(stored("box"))
    T = placed(0.02, -0.03, 0.5)
    frame = photograph({ID: in_camera(MESHES["box"](), T)})
    config = ObservationConfig()
    scene = observe(frame, config, 0)
    observation, plane = scene.objects[ID], scene.plane
    noise = pixel_noise(frame, plane, CONFIG.sensor)

    def shown():
        surface = seen_surface(frame, ID, plane, noise, CONFIG.mean.ramp)
        return shown_of(surface, observation, plane, config.surface_cell, CONFIG)

    middle = similarity(translation=model.stored.center)
    placement = Hypothesis(model, T @ middle, 1.0, 0.95)
    shape = placed_shape(placement, observation.points, noise.wave, CONFIG)

    def mean(weight: float) -> MeanGrid:
        posterior, _ = infer_object(
            observation,
            frame,
            plane,
            shown,
            noise.wave,
            [shape],
            np.array([1 - weight, weight]),
            CONFIG,
            ALONE,
            trusted=True,
            seed=0,
            device="cpu",
        )
        return posterior.means[-1]

    return mean


def test_an_eighth_of_the_nodes_for_less_than_a_tenth_of_the_weight(completed):
    fine, coarse = completed(0.5), completed(0.05)
    assert coarse.spacing == pytest.approx(2 * fine.spacing, rel=0.02)
    low, high = fine.bounds
    points = np.random.default_rng(0).uniform(low, high, (20_000, 3))
    one, other = fine.logits(points) > 0, coarse.logits(points) > 0
    assert one.mean() > 0.02
    assert (one & other).sum() > 0.85 * (one | other).sum()


def test_from_a_tenth_on_it_is_as_fine_as_any(completed):
    assert completed(CONFIG.mean.minor).spacing == completed(0.9).spacing
