"""A prior of a box and a can, and how well a surface agrees with a true mesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from table_scene import box

from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters
from brrp_cli.raycast import inside
from brrp_cli.shapes import solids


def can() -> trimesh.Trimesh:
    return solids.cylinder(0.04, 0.12)


def iou(surface, mesh):
    """Of a reconstructed surface with the true mesh, both in the camera frame."""
    low, high = mesh.bounds[0] - 0.04, mesh.bounds[1] + 0.04
    points = np.random.default_rng(0).uniform(low, high, (20_000, 3))
    found, true = inside(surface.as_trimesh(), points), inside(mesh, points)
    return (found & true).sum() / (found | true).sum()


@pytest.fixture(scope="session")
def box_and_can(tmp_path_factory):
    """A prior of the two, as `brrp build-prior` makes it."""
    meshes = tmp_path_factory.mktemp("meshes")
    box().export(meshes / "box.ply")
    can().export(meshes / "can.ply")
    out = tmp_path_factory.mktemp("prior") / "prior"
    looks = AppearanceConfig(views=8, rays=500)
    parameters = BuildParameters(samples=1000, dense_points=5000, appearance=looks)
    build_prior(meshes, out, parameters, workers=1)
    return out
