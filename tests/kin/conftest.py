"""A prior of a box, a bowl and a can."""

from __future__ import annotations

import pytest
from table_scene import box

from brrp_cli import open_prior
from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.shapes import solids


@pytest.fixture(scope="session")
def prior(tmp_path_factory):
    meshes = tmp_path_factory.mktemp("kin_meshes")
    box().export(meshes / "box.ply")
    solids.spherical_bowl(0.035, 0.070, 0.050, 0.005).export(meshes / "bowl.ply")
    solids.cylinder(0.04, 0.12).export(meshes / "can.ply")
    out = tmp_path_factory.mktemp("kin_prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(samples=500, dense_points=5000, appearance=looks)
    build_prior(meshes, out, parameters, workers=1)
    return open_prior(out)
