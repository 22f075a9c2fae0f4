"""The starter set: every shape is usable as it is."""

import manifold3d
import numpy as np
import pytest

from brrp_cli.shapes.household import household_shapes, household_variations

SHAPES = household_shapes() + household_variations()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
def test_shapes_are_closed_outward_and_stand_on_the_table(shape):
    mesh = shape.mesh
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-9)
    solid = manifold3d.Manifold(
        manifold3d.Mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    )
    assert solid.status() == manifold3d.Error.NoError
    assert solid.volume() == pytest.approx(mesh.volume, rel=1e-4)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
def test_shapes_have_household_sizes_names_and_colours(shape):
    assert 0.06 < shape.mesh.extents.max() < 0.35
    assert shape.mesh.extents.min() > 0.02
    assert shape.description.startswith(("a ", "an "))
    assert all(0 <= value <= 255 for value in shape.color)


def test_names_and_descriptions_are_unique():
    assert len({shape.name for shape in SHAPES}) == len(SHAPES)
    assert len({shape.description for shape in SHAPES}) == len(SHAPES)


def test_variations_differ_in_size_from_every_starter_shape():
    stored = [np.sort(shape.mesh.extents) for shape in household_shapes()]
    for shape in household_variations():
        extents = np.sort(shape.mesh.extents)
        assert min(np.abs(extents - other).max() for other in stored) > 0.005, shape.name


def test_the_starter_set_is_the_same_each_time():
    for first, second in zip(household_shapes(), household_shapes(), strict=True):
        assert first.mesh.vertices.tobytes() == second.mesh.vertices.tobytes()
        assert first.mesh.faces.tobytes() == second.mesh.faces.tobytes()
