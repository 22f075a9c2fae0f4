"""What tests of the builder share: small parameters, three meshes, a prior's bytes."""

from __future__ import annotations

from pathlib import Path

import trimesh

from brrp_cli.config import FeatureConfig
from brrp_cli.prior.parameters import AppearanceConfig, BuildParameters, FieldConfig

# The little of each object that makes its stages run: a fifth of a second.

SMALL = BuildParameters(
    samples=400,
    surface_points=200,
    dense_points=2_000,
    features=FeatureConfig(scales=(0.5, 1.0), voxel=0.02),
    appearance=AppearanceConfig(views=2, rays=60),
    distances=FieldConfig(nodes=500),
)


def write_meshes(folder: Path) -> Path:
    """A box, an L of two overlapping boxes and a ball, 1 to 3 bodies of plain geometry."""
    folder.mkdir(parents=True, exist_ok=True)
    box = trimesh.creation.box((0.10, 0.06, 0.04))
    box.export(folder / "red_box.obj")
    arm = trimesh.creation.box((0.04, 0.12, 0.04))
    arm.apply_translation((0.04, 0.05, 0.0))
    trimesh.util.concatenate([box, arm]).export(folder / "ell.ply")
    trimesh.creation.icosphere(subdivisions=2, radius=0.04).export(folder / "ball.stl")
    return folder


def prior_bytes(folder: Path) -> dict[str, bytes]:
    """Every file of a prior but the lock."""
    files = [p for p in folder.rglob("*") if p.is_file() and p.name != ".lock"]
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}
