"""Round things that the prior lacks: they are turned, and solid kin give way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import in_camera, photograph, placed

from brrp_cli import reconstruct
from brrp_cli.config import preset
from brrp_cli.ground_truth.surface_metrics import MeshSurface
from brrp_cli.inference.placed_shape import PlacedShape
from brrp_cli.methods.kin_hypotheses import KinHypothesis, beside_round
from brrp_cli.shapes import solids

ID = 3
CONFIG = preset("default")
KIN = CONFIG.hypotheses.kin
VASE = [(0, 0), (0.03, 0), (0.06, 0.05), (0.055, 0.09), (0.025, 0.14), (0.03, 0.16), (0, 0.16)]


def turning(enabled):
    mean = CONFIG.hypotheses.mean
    mean = replace(mean, revolution=replace(mean.revolution, enabled=enabled))
    return replace(CONFIG, hypotheses=replace(CONFIG.hypotheses, mean=mean))


@pytest.mark.parametrize("lying", [False, True])
def test_a_vase_has_its_back(prior, lying):
    vase = solids.revolve(np.array(VASE))
    truth = in_camera(solids.laid_down(vase) if lying else vase, placed(0.0, 0.0, 1.2))
    points = truth.sample(2000, seed=0)
    means = []
    for enabled in (True, False):
        made = reconstruct(photograph({ID: truth}), prior, config=turning(enabled)).objects[0]
        assert made.like is None
        mesh = MeshSurface(made.surface.as_trimesh())
        means.append(np.abs(mesh.nearest(points).distance).mean())
    assert means[0] < 0.001 and means[0] < 0.6 * means[1]


def test_solid_kin_give_way_and_hollow_ones_stay():
    def like(walls, share):
        shape = PlacedShape("a", None, np.eye(4), 0.001, 5.0, np.zeros((6, 6)), kin=True)
        return KinHypothesis(shape, share, (1.0, 1.0, 1.0), walls)

    left = beside_round([like(0.0, 0.4), like(0.5, 0.6), like(1.0, 0.3)], KIN)
    assert [each.share for each in left] == pytest.approx([0.3, 0.3])
