"""A small prior of three shapes, built once by the real builder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from small_prior import SMALL, write_meshes

from brrp_cli.prior.build.build import build_prior
from brrp_cli.prior.parameters import BuildParameters


@pytest.fixture(scope="session")
def small() -> BuildParameters:
    return SMALL


@pytest.fixture(scope="session")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_meshes(tmp_path_factory.mktemp("meshes"))


@pytest.fixture(scope="session")
def pristine(meshes: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("prior") / "prior"
    build_prior(meshes, out, SMALL, workers=1)
    return out


@pytest.fixture
def prior_folder(pristine: Path, tmp_path: Path) -> Path:
    """A copy to damage."""
    return Path(shutil.copytree(pristine, tmp_path / "prior"))
