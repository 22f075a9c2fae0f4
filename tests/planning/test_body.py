"""Bodies: their axes, their mass, and what puts them onto the table."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from brrp_cli.geometry import similarity
from brrp_cli.planning.body import Body, body_axes, lift_onto, mass_and_inertia
from brrp_cli.planning.numbers import quaternion_wxyz, spell
from brrp_cli.shapes import solids

unit = st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1)


@settings(deadline=None)
@given(unit, unit)
def test_axes_are_a_rotation_with_z_up(up, ahead):
    axes = body_axes(np.array(up), np.array(ahead))
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1)
    np.testing.assert_allclose(axes[:, 2], np.array(up) / np.linalg.norm(up), atol=1e-9)
    assert axes[:, 0] @ ahead >= -1e-6


def test_the_inertia_of_a_box_is_the_books():
    width, depth, height, density = 0.1, 0.2, 0.3, 700.0
    mass, inertia = mass_and_inertia(solids.box(width, depth, height), density)
    assert mass == pytest.approx(density * width * depth * height)
    expected = (
        mass / 12 * np.array([depth**2 + height**2, width**2 + height**2, width**2 + depth**2])
    )
    np.testing.assert_allclose(inertia, np.diag(expected), rtol=1e-9, atol=1e-12)


@settings(deadline=None)
@given(st.floats(-0.05, 0.05))
def test_a_body_is_lifted_by_what_lies_below_the_table(height):
    mesh = solids.box(0.1, 0.1, 0.1)
    T = similarity(1.0, None, np.array([0.3, 0.2, height]))
    body = Body("b", T, mesh, mesh, [np.asarray(mesh.vertices)], 1.0, np.eye(3), np.zeros(3))
    # The box stands on z = 0 of its own frame.
    assert lift_onto(body, np.array([0.0, 0, 1]), 0.0) == pytest.approx(max(0.0, -height))


def test_quaternions_have_w_first():
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1])[:3, :3]
    np.testing.assert_allclose(quaternion_wxyz(turn), [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert spell([1, 0.5, -1e-7]) == "1 0.5 -1e-07"
