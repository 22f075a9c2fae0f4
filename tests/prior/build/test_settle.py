"""A wrap is laid onto what it was made around, and leaves sheets a wall."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from mesh_zoo import box, moved_box, triangles

from brrp_cli.prior.build.repair import repair
from brrp_cli.prior.build.settle import settled
from brrp_cli.prior.build.solids import is_solid
from brrp_cli.prior.parameters import RepairConfig

OFFSET = 0.002
SPANNING = RepairConfig().spanning


def around_the_box() -> trimesh.Trimesh:
    """What lies an offset outside of the box."""
    wider = box()
    wider.apply_scale((wider.extents + 2 * OFFSET) / wider.extents)
    return wider.subdivide_to_size(0.01)


def test_a_wrap_around_a_solid_is_the_solid() -> None:
    found = settled(around_the_box(), box(), OFFSET, wall=0.001, spanning=SPANNING)
    assert is_solid(found)
    np.testing.assert_allclose(found.extents, box().extents, atol=1e-6)
    assert found.volume == pytest.approx(box().volume, rel=1e-3)


def test_a_wrap_around_a_sheet_keeps_a_wall() -> None:
    sheet = triangles(
        np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    around = trimesh.creation.box(extents=[0.2 + 2 * OFFSET] * 2 + [2 * OFFSET])
    for wall in (0.001, 0.003):
        found = settled(around.subdivide_to_size(0.01), sheet, OFFSET, wall, SPANNING)
        middle = np.abs(found.vertices[:, :2]).max(axis=1) < 0.095
        np.testing.assert_allclose(np.abs(found.vertices[middle, 2]), wall / 2, atol=1e-6)


def test_a_wall_is_never_made_thicker() -> None:
    thin = trimesh.creation.box(extents=[0.1, 0.1, 0.001]).subdivide_to_size(0.01)
    found = settled(thin, thin, OFFSET, wall=0.004, spanning=SPANNING)
    assert found.extents[2] == pytest.approx(0.001)
    assert found.volume == pytest.approx(thin.volume)


def test_over_an_opening_the_wrap_sinks_by_its_offset() -> None:
    """A box without its top, a wrap that spans it: the top comes down to where the rim is."""
    open_box = box()
    top = open_box.face_normals[:, 2] > 0.5
    open_box.update_faces(~top)
    found = settled(around_the_box(), open_box, OFFSET, wall=0.001, spanning=SPANNING)
    middle = (np.abs(found.vertices[:, :2]) < 0.015).all(axis=1) & (found.vertices[:, 2] > 0)
    assert middle.any()
    np.testing.assert_allclose(found.vertices[middle, 2], box().bounds[1, 2], atol=1e-6)


def test_what_had_to_be_wrapped_is_as_large_as_it_was() -> None:
    """A tube whose open ends are hidden in two boxes."""
    tube = trimesh.creation.cylinder(radius=0.015, height=0.09, sections=48)
    tube.update_faces(np.abs(tube.face_normals[:, 2]) < 0.5)
    tube.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    boxes = [moved_box(-0.075, 0, 0), moved_box(0.075, 0, 0)]
    repaired = repair(trimesh.util.concatenate([tube, *boxes]))
    assert "wrapped" in "; ".join(repaired.record["steps"])
    assert is_solid(repaired.mesh)
    np.testing.assert_allclose(repaired.mesh.extents, [0.25, 0.06, 0.04], atol=1e-4)
    volume = 2 * box().volume + np.pi * 0.015**2 * 0.05
    assert repaired.mesh.volume == pytest.approx(volume, rel=0.02)
    assert repaired.record["repaired_to_original"]["mean"] < 2e-4
