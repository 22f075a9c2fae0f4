"""Median thickness of shapes whose thickness is known."""

import math

import numpy as np
import pytest
import trimesh

from brrp_cli.ground_truth.thickness import median_thickness, thickness_class
from brrp_cli.ground_truth.true_meshes import exact_truth
from brrp_cli.ground_truth.truth import TrueObject
from brrp_cli.shapes import solids


def cup(wall: float) -> trimesh.Trimesh:
    """Open at the top, with a bottom as thick as its wall."""
    outer = trimesh.creation.cylinder(0.04, 0.1, sections=64)
    inner = trimesh.creation.cylinder(0.04 - wall, 0.1, sections=64)
    return outer.difference(inner.apply_translation([0, 0, wall]), engine="manifold")


SHAPES = {
    "cup": (cup(0.002), 0.002, "shell"),
    "plate": (trimesh.creation.box((0.2, 0.2, 0.004)), 0.004, "shell"),
    "board": (trimesh.creation.box((0.2, 0.15, 0.02)), 0.02, "thin"),
    "box": (trimesh.creation.box((0.1, 0.1, 0.1)), 0.1, "solid"),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("offset", [0.0, 40.0])
def test_the_median_is_the_wall(name, offset):
    mesh, thickness, kind = SHAPES[name]
    found = median_thickness(mesh.copy().apply_translation([offset] * 3))
    assert found == pytest.approx(thickness, rel=0.02)
    assert thickness_class(found) == kind


def test_classes_begin_at_their_limits():
    assert [thickness_class(t) for t in (0.0049, 0.005, 0.0249, 0.025)] == [
        "shell",
        "thin",
        "thin",
        "solid",
    ]


def test_nothing_has_no_thickness():
    assert math.isnan(median_thickness(trimesh.Trimesh()))


def test_thickness_follows_the_scale_of_a_scene_and_is_kept_by_the_mesh(tmp_path):
    solids.box(0.1, 0.1, 0.02).export(tmp_path / "board.ply")
    cache = tmp_path / "cache"
    own = TrueObject(1, "board.ply", np.eye(4))
    twice = TrueObject(2, "board.ply", np.diag([2.0, 2.0, 2.0, 1.0]))
    assert exact_truth(own, tmp_path, cache).thickness == pytest.approx(0.02, rel=0.01)
    (kept,) = cache.glob("*-thickness.npz")
    found = exact_truth(twice, tmp_path, cache)
    assert found.thickness == pytest.approx(0.04, rel=0.01) and found.pieces == 1
    assert found.mesh.extents == pytest.approx([0.2, 0.2, 0.04])
    # What is kept is what is used.
    np.savez(kept, thickness=0.03, pieces=5)
    again = exact_truth(own, tmp_path, cache)
    assert (again.thickness, again.pieces) == (pytest.approx(0.03), 5)
