"""What is guessed is the less certain, the further it is from what was seen; the rest is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from closed_shapes import at

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import similarity
from brrp_cli.inference.hinge import HingeGrid
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.mean_grid import MeanGrid
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.surface.extract import extract_surface

CENTER = np.array([0.1, -0.05, 0.8])
SIDES = np.array([0.06, 0.05, 0.04])
# The face towards the camera is all that was seen.
SEEN = CENTER - [0, 0, 0.02] + np.mgrid[-6:7, -5:6, 0:1].reshape(3, -1).T * [0.005, 0.005, 0]
NOTHING, FIFTH = SurfaceConfig(guessed=0.0), SurfaceConfig(guessed=0.2)


@pytest.fixture(scope="module")
def block():
    return at(
        trimesh.creation.box(SIDES), similarity(1.0, np.eye(3), CENTER), name="b", width=0.001
    )


@pytest.fixture(scope="module")
def completed():
    """The logit of the same block on a grid, as the completion gives it."""
    lower, spacing = CENTER - 0.05, 0.0025
    nodes = lower + np.stack(np.mgrid[:41, :41, :41], axis=-1) * spacing
    inside = (SIDES / 2 - np.abs(nodes - CENTER)).min(axis=-1)
    return MeanGrid(lower, spacing, np.clip(inside / 0.001, -6, 6).astype(np.float16), -6.0)


def surfaces(means, shares):
    """Without and with what is guessed, of hypotheses without corrections."""
    grid = HingeGrid((0.0, 0.0, 0.0), (1, 1, 1), 1.0, 1e-7)
    weights = np.zeros((len(means), grid.dimension), np.float32)
    box = np.stack([CENTER - 0.05, CENTER + 0.05])
    posterior = HypothesisPosterior(
        tuple(means),
        np.arange(len(means)),
        np.array(shares),
        HilbertPosterior(weights, CENTER, grid, 0.1),
        box,
    )
    return [extract_surface(posterior, SEEN, config) for config in (NOTHING, FIFTH)]


@pytest.mark.parametrize("kind", ["kin", "completed"])
def test_a_fifth_of_the_way_to_what_was_seen_is_added_in_squares(block, completed, kind):
    means = [replace(block, kin=True) if kind == "kin" else completed]
    plain, told = surfaces(means, [1.0])
    np.testing.assert_array_equal(plain.vertices, told.vertices)
    added = np.sqrt(told.uncertainty.astype(float) ** 2 - plain.uncertainty.astype(float) ** 2)
    depth = plain.vertices[:, 2] - SEEN[0, 2]
    back = depth > 0.039
    assert back.sum() > 3
    # The face behind is 4 cm off what was seen.
    np.testing.assert_allclose(added[back], 0.2 * 0.04, rtol=0.03)
    assert (added[depth < 0.001] < 0.001).all()


def test_what_is_recognised_keeps_its_own(block):
    plain, told = surfaces([block], [1.0])
    np.testing.assert_array_equal(plain.uncertainty, told.uncertainty)


def test_only_the_weight_of_guesses_counts(block, completed):
    """A placement that explains less than half: the surface is the grid's."""
    away = replace(block, T_cam_shape=similarity(translation=[0.0, 0, 0.002]) @ block.T_cam_shape)
    plain, told = surfaces([away, completed], [0.36, 0.64])
    added = np.sqrt(told.uncertainty.astype(float) ** 2 - plain.uncertainty.astype(float) ** 2)
    back = plain.vertices[:, 2] > CENTER[2] + 0.0195
    np.testing.assert_allclose(added[back].min(), 0.8 * 0.2 * 0.04, rtol=0.05)
