"""A starter prior of two shapes, built once: the same path as the whole one in seconds."""

import pytest

from brrp_cli.prior.build import starter
from brrp_cli.shapes.household import household_shapes

NAMES = ("soup_can", "wood_block")


@pytest.fixture(scope="session")
def data_home(tmp_path_factory):
    return tmp_path_factory.mktemp("data")


@pytest.fixture
def two_shapes(data_home, monkeypatch):
    """The starter set and the user's data folder of these tests."""
    few = [shape for shape in household_shapes() if shape.name in NAMES]
    monkeypatch.setattr(starter, "household_shapes", lambda: few)
    monkeypatch.setenv("XDG_DATA_HOME", str(data_home))
    monkeypatch.delenv("BRRP_PRIOR", raising=False)
    return few
