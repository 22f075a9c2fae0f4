"""Signed distances of stored shapes, against solids whose distance is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from closed_shapes import CUP_HEIGHT, CUP_RADIUS, CUP_WALL, cup, stored

HALF = np.array([1.0, 0.6, 0.3])
BAND = 0.3


@pytest.fixture(scope="module")
def box():
    return stored(trimesh.creation.box(2 * HALF))[0]


@pytest.fixture(scope="module")
def ball():
    return stored(trimesh.creation.icosphere(subdivisions=4, radius=1.0))[0]


@pytest.fixture(scope="module")
def thin():
    """The shape of a cup, and metres of its unit."""
    shape, T = stored(cup())
    return shape, T[0, 0]


def box_distance(points):
    beyond = np.abs(points) - HALF
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def ball_distance(points):
    return np.linalg.norm(points, axis=1) - 1


def everywhere(reach, count=6000):
    return np.random.default_rng(0).uniform(-reach, reach, (count, 3))


@pytest.mark.parametrize("reach", [1.1, 1.6], ids=["on the grid", "off the grid"])
@pytest.mark.parametrize(
    ("name", "distance", "tolerance"),
    # The triangles of the ball lie within 3 thousandths of its radius below the true surface.
    [("box", box_distance, 1e-5), ("ball", ball_distance, 3e-3)],
)
def test_within_the_band_the_distance_is_exact(request, name, distance, tolerance, reach):
    shape = request.getfixturevalue(name)
    points = everywhere(reach)
    true, found = distance(points), shape.signed_distance(points, BAND)
    near = np.abs(true) < BAND
    assert near.sum() > 500
    assert np.abs(found - true)[near].max() < tolerance
    assert np.abs(shape.field.signed_distance(points) - true)[near].max() > 2 * tolerance


@pytest.mark.parametrize("band", [0.0, BAND])
@pytest.mark.parametrize(
    ("name", "distance", "tolerance"), [("box", box_distance, 1e-5), ("ball", ball_distance, 3e-3)]
)
def test_the_sign_is_right_everywhere(request, name, distance, tolerance, band):
    points = everywhere(2.5)
    true = distance(points)
    found = request.getfixturevalue(name).signed_distance(points, band)
    sure = np.abs(true) > tolerance
    np.testing.assert_array_equal((found < 0)[sure], (true < 0)[sure])


def test_beyond_the_band_the_distance_is_never_within_it(ball):
    """Or what lies further away would have a say near the surface."""
    points = everywhere(2.5)
    outside = np.abs(ball_distance(points)) > BAND + 3e-3
    assert (np.abs(ball.signed_distance(points, BAND))[outside] > BAND).all()


def test_a_wall_of_a_millimetre_and_a_half_is_as_thick_as_it_is(thin):
    """Points on both faces of the wall and inside of it, though a node of the field is 8 mm from
    the next."""
    shape, unit = thin
    assert shape.field.spacing * unit > 3 * CUP_WALL
    wall = CUP_WALL / unit
    mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    points, faces = trimesh.sample.sample_surface(mesh, 3000, seed=0)
    # Away from rim and floor, where another face may be nearer.
    sides = np.abs(mesh.face_normals[faces, 2]) < 1e-3
    sides &= np.abs(points[:, 2]) < 0.8 * CUP_HEIGHT / 2 / unit
    points, normals = points[sides], mesh.face_normals[faces[sides]]
    assert len(points) > 1000
    for offset in (-0.45 * wall, -0.2 * wall, 0.2 * wall, 2 * wall):
        found = shape.signed_distance(points + offset * normals, band=3 * wall)
        np.testing.assert_allclose(found, offset, atol=0.01 * wall)


def test_a_cup_is_hollow_and_its_wall_is_not(thin):
    shape, unit = thin
    points = everywhere(1.2) * [0.9, 0.9, 1.05]
    height = points[:, 2] * unit + CUP_HEIGHT / 2
    radius = np.linalg.norm(points[:, :2], axis=1) * unit
    wall = (radius < CUP_RADIUS) & ((radius > CUP_RADIUS - CUP_WALL) | (height < CUP_WALL))
    inside = wall & (height > 0) & (height < CUP_HEIGHT)
    # A revolved polygon lies within a tenth of a millimetre of the circle.
    edges = (CUP_RADIUS, CUP_RADIUS - CUP_WALL)
    sure = np.abs(radius[:, None] - edges).min(axis=1) > 1e-4
    for band in (0.0, 0.1):
        found = shape.signed_distance(points, band) < 0
        np.testing.assert_array_equal(found[sure], inside[sure])
    assert inside.sum() > 100


def test_points_may_be_of_any_precision_and_none(box):
    points = everywhere(1.2, 50)
    single = box.signed_distance(points.astype(np.float32), BAND)
    np.testing.assert_allclose(single, box.signed_distance(points, BAND), atol=1e-5)
    assert box.signed_distance(np.zeros((0, 3)), BAND).shape == (0,)


def test_normals_point_outwards_at_unit_length(ball, thin):
    np.testing.assert_allclose(ball.normals, ball.vertices, atol=0.01)
    shape, unit = thin
    step = 0.2 * CUP_WALL / unit
    for sign in (1, -1):
        moved = shape.signed_distance(shape.vertices + sign * step * shape.normals, 0.1)
        assert (sign * moved > 0).all()
