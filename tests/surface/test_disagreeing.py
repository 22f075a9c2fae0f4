"""Hypotheses that disagree so much that no place is occupied more probably than not."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from closed_shapes import at

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import similarity
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.raycast import surface_scene
from brrp_cli.surface.confidence import confidence_surface
from brrp_cli.surface.extract import extract_surface

CENTER = np.array([0.1, -0.05, 0.8])
RADIUS = 0.02
CONFIG = SurfaceConfig()
# The observed points lie between the balls, in none of them.
SEEN = CENTER + np.mgrid[-3:4, -3:4, 0:1].reshape(3, -1).T * 0.002


def three_balls(*shares):
    """Balls of three names about the middle, none of which touches another."""
    ball = trimesh.creation.icosphere(3, RADIUS)
    away = 0.024 * np.array([[1, 0, 0], [-0.5, 0.87, 0], [-0.5, -0.87, 0]])
    means = [
        at(ball, similarity(1.0, np.eye(3), CENTER + shift), name=f"ball {i}")
        for i, shift in enumerate(away)
    ]
    grid = HingeGrid((0.0, 0.0, 0.0), (1, 1, 1), 1.0, 1e-7)
    weights = np.zeros((3, grid.dimension), np.float32)
    box = np.stack([CENTER - 0.06, CENTER + 0.06])
    return CENTER + away, HypothesisPosterior(
        tuple(means),
        np.arange(3),
        np.array(shares),
        HilbertPosterior(weights, CENTER, grid, 0.1),
        box,
    )


@pytest.mark.parametrize(("shares", "heaviest"), [((0.45, 0.3, 0.25), 0), ((0.2, 0.38, 0.42), 2)])
def test_the_heaviest_hypothesis_is_the_surface(shares, heaviest):
    middles, posterior = three_balls(*shares)
    assert posterior.dominant is None
    assert posterior.probability(middles).max() < 0.5
    surface = extract_surface(posterior, SEEN, CONFIG)
    assert surface is not None
    mesh = surface.as_trimesh()
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.center_mass, middles[heaviest], atol=1e-3)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.03)


def test_its_place_is_told_to_be_unsure():
    unsure = extract_surface(three_balls(0.45, 0.3, 0.25)[1], SEEN, CONFIG)
    sure = extract_surface(three_balls(0.96, 0.02, 0.02)[1], SEEN, CONFIG)
    assert np.median(unsure.uncertainty) > 2 * np.median(sure.uncertainty)


def test_the_region_that_holds_the_object_holds_all_of_them():
    middles, posterior = three_balls(0.45, 0.3, 0.25)
    region = confidence_surface(posterior, SEEN, 0.9, CONFIG)
    scene = surface_scene(region.vertices, region.faces)
    assert scene.compute_occupancy(middles.astype(np.float32)).numpy().all()
