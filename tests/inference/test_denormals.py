"""No stage makes denormal numbers, which some processors multiply 20 times more slowly."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from table_scene import box, in_camera, photograph, placed

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from speed.denormals import count_denormals, watch_denormals

from brrp_cli import open_prior, reconstruct
from brrp_cli.config import preset
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters

TINY = float(np.finfo(np.float32).smallest_normal)


def test_denormals_of_an_array_are_counted():
    values = [0.0, -0.0, TINY, -TINY, TINY / 2, -TINY / 8, 1.0, np.inf, -np.inf, np.nan, 1e-45]
    assert count_denormals(np.array(values, np.float32)) == 3
    assert count_denormals(torch.tensor(values, dtype=torch.float32)[None, ::2]) == 2
    assert count_denormals(np.array(values, np.float64)) == 0
    assert count_denormals(np.array([1e-310, 2.3e-308, -5e-324])) == 2
    assert count_denormals(np.array([1, 2])) == 0
    assert count_denormals(torch.empty(3, device="meta")) == 0


def test_what_is_made_within_an_operation_of_torch_is_seen():
    with watch_denormals() as found:
        torch.exp(torch.tensor([-95.0])) * 0
    assert sum(found.values()) == 1


@pytest.fixture(scope="module")
def frame():
    return photograph({7: in_camera(box(), placed(0.0, 0.0, 0.7))})


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    meshes = tmp_path_factory.mktemp("meshes")
    box().export(meshes / "box.ply")
    out = tmp_path_factory.mktemp("prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(samples=1000, dense_points=5000, appearance=looks)
    build_prior(meshes, out, parameters, workers=1)
    return open_prior(out)


class Halves:
    """As likely the box as an unknown object: particles of both, a placed and a completed mean."""

    name = "halves"

    def probabilities(self, frame, object_id):
        return np.array([0.5])


@pytest.mark.parametrize("name", ["default", "paper"])
def test_brrp_makes_none(frame, prior, name):
    """Observation, pose search, means, hinge features, SVGD and the grid of the surface."""
    config = preset(name)
    if config.hypotheses is not None:
        even = replace(
            config.hypotheses.likelihood, most_votes=1e-9, below=0.0, colour=0.0, base=0.0
        )
        config = replace(config, hypotheses=replace(config.hypotheses, likelihood=even))
    else:
        config = replace(
            config,
            inference=replace(config.inference, epochs=1),
            registration=replace(config.registration, iterations=1000),
        )
    with watch_denormals() as found:
        result = reconstruct(frame, prior, config=config, retriever=Halves(), workers=1)
    (item,) = result.objects
    assert item.surface is not None
    if name == "default":
        assert len(set(item.posterior.which)) > 1
    assert not found


def test_vprism_makes_none(frame):
    with watch_denormals() as found:
        (item,) = reconstruct(frame, method="vprism", workers=1).objects
        points = item.observed[::50]
        item.posterior.probability(points)
        item.posterior.uncertainty(points)
    assert not found
