"""Any occupancy: a closed, outward, finite mesh in metres, no mesh, or an error of ours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from brrp_cli.config import SurfaceConfig
from brrp_cli.errors import BrrpError
from brrp_cli.reconstruction import METRES
from brrp_cli.surface.extract import extract_surface, grid_spacing, level_set

SPACING = 0.005
# As fine as the grid below is.
CONFIG = SurfaceConfig(spacing=SPACING, finest=SPACING)
CELLS = 7
SIDE = SPACING * (CELLS - 1)


@dataclass
class Grid:
    """A posterior that is given on the grid that will be asked for."""

    values: np.ndarray
    doubt: float = 0.01

    @property
    def bounds(self) -> np.ndarray:
        return np.array([[0.1, -0.2, 0.7], [0.1 + SIDE, -0.2 + SIDE, 0.7 + SIDE]])

    surface_unit = METRES

    def probability_volume(self, axes) -> np.ndarray:
        assert [len(axis) for axis in axes] == [CELLS] * 3
        return self.values

    def surface_uncertainty(self, vertices) -> np.ndarray:
        return np.full(len(vertices), self.doubt, np.float32)


OBSERVED = np.array([[0.1, -0.2, 0.7]]) + SIDE / 2


@settings(deadline=None, max_examples=150)
@given(
    values=hnp.arrays(
        np.float32,
        (CELLS,) * 3,
        elements=st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]) | st.floats(0, 1, width=32),
        fill=st.sampled_from([0.0, 1.0]),
    )
)
def test_any_occupancy_gives_a_closed_outward_mesh_or_none(values: np.ndarray) -> None:
    surface = extract_surface(Grid(values), OBSERVED, CONFIG)
    if surface is None:
        return
    # As it is written and read: single precision.
    mesh = trimesh.Trimesh(surface.vertices.astype(np.float32), surface.faces, process=False)
    assert np.isfinite(mesh.vertices).all() and np.isfinite(surface.uncertainty).all()
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume > 0
    low, high = Grid(values).bounds
    assert (mesh.vertices >= low - SPACING - 1e-6).all()
    assert (mesh.vertices <= high + SPACING + 1e-6).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_occupancy_that_is_no_number_never_becomes_a_mesh(bad: float) -> None:
    values = np.zeros((CELLS,) * 3, np.float32)
    values[2:5, 2:5, 2:5] = 1
    assert extract_surface(Grid(values), OBSERVED, CONFIG) is not None
    with pytest.raises(BrrpError, match="surface gave numbers that are NaN"):
        extract_surface(Grid(values, doubt=bad), OBSERVED, CONFIG)
    values[0, 0, 0] = bad
    with pytest.raises(BrrpError, match="posterior gave numbers that are NaN"):
        extract_surface(Grid(values), OBSERVED, CONFIG)


def test_an_object_wider_than_memory_is_refused_before_it_is_asked() -> None:
    class Wide(Grid):
        bounds = np.array([[-40.0, -28, 0], [0, 0, 90]])

        def probability_volume(self, axes) -> np.ndarray:
            raise AssertionError("it was asked")

    with pytest.raises(BrrpError, match="too wide for a surface") as caught:
        extract_surface(Wide(np.zeros(1)), OBSERVED, CONFIG)
    assert "40.00 x 28.00 x 90.00 m" in str(caught.value)


def holed() -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """A ball of 3 cm with a cavity of 1 cm in it, and a smaller ball beside it."""
    axes = tuple(np.arange(low, low + 0.12, 0.003) for low in (0.0, 0.0, 0.0))
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    from_middle = np.linalg.norm(nodes - 0.04, axis=-1)
    distance = np.maximum(from_middle - 0.03, 0.01 - from_middle)
    beside = np.linalg.norm(nodes - [0.095, 0.095, 0.095], axis=-1) - 0.012
    return 1 / (1 + np.exp(np.minimum(distance, beside) / 0.001)), axes


def test_a_level_set_is_one_closed_piece_without_cavities() -> None:
    volume, axes = holed()
    found = level_set(volume, axes, np.array([[0.04, 0.04, 0.01]]), 0.5, SurfaceConfig())
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.03**3, rel=0.02)
    np.testing.assert_allclose(mesh.bounds, [[0.01] * 3, [0.07] * 3], atol=2e-4)


@pytest.mark.parametrize("level", [0.1, 0.5, 0.9])
def test_a_level_set_lies_where_the_level_is(level: float) -> None:
    """Between nodes 3 mm apart a logistic of 1 mm is not a straight line."""
    volume, axes = holed()
    found = level_set(volume, axes, np.array([[0.04, 0.04, 0.01]]), level, SurfaceConfig())
    radius = np.linalg.norm(found.vertices - 0.04, axis=1)
    assert radius.mean() == pytest.approx(0.03 - 0.001 * np.log(level / (1 - level)), abs=8e-4)


@pytest.mark.parametrize(
    ("size", "spacing"),
    [((0.05, 0.05, 0.05), 0.002), ((0.2, 0.2, 0.2), 0.003), ((0.6, 0.6, 0.6), 0.005)],
)
def test_the_grid_is_as_fine_as_its_nodes_allow_and_no_finer_than_it_must_be(
    size: tuple[float, ...], spacing: float
) -> None:
    bounds = np.array([[0.1, -0.2, 0.7], np.add([0.1, -0.2, 0.7], size)])
    assert grid_spacing(bounds, SurfaceConfig()) == pytest.approx(spacing, rel=0.01)
