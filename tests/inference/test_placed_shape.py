"""A stored shape where a hypothesis puts it: logits in metres of the camera's frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from closed_shapes import at

from brrp_cli.geometry import similarity, transform_points

HALF = np.array([0.05, 0.03, 0.02])
WIDTH, LIMIT = 0.001, 5.0
TURN = trimesh.transformations.rotation_matrix(0.8, [1, 2, 3])[:3, :3]
PLACES = {
    "as it is": np.eye(4),
    "moved and turned": similarity(1.0, TURN, np.array([0.1, -0.2, 0.9])),
    "and grown": similarity(1.3, TURN, np.array([0.1, -0.2, 0.9])),
    "and shrunk": similarity(0.6, TURN, np.array([-0.3, 0.2, 0.5])),
}


@pytest.fixture(scope="module")
def unmoved():
    return at(trimesh.creation.box(2 * HALF))


@pytest.fixture(params=PLACES)
def placed(request, unmoved):
    """The box somewhere, and T_cam_box."""
    T = PLACES[request.param]
    return replace(unmoved, T_cam_shape=T @ unmoved.T_cam_shape), T


def box_distance(points):
    beyond = np.abs(points) - HALF
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def around(count=3000, margin=0.008):
    return np.random.default_rng(0).uniform(-1, 1, (count, 3)) * (HALF + margin)


def size_of(T):
    return np.cbrt(np.linalg.det(T[:3, :3]))


def test_the_logit_is_minus_the_distance_over_the_width_within_the_limit(placed):
    shape, T = placed
    local = around()
    true = box_distance(local) * size_of(T)
    found = shape.logits(transform_points(T, local))
    np.testing.assert_allclose(found, np.clip(-true / WIDTH, -LIMIT, LIMIT), atol=0.02)
    assert (np.abs(found) < LIMIT).sum() > 500 and found.dtype == np.float32


def test_the_distance_is_in_metres_and_exact_in_the_band(placed):
    shape, T = placed
    local = around()
    true = box_distance(local) * size_of(T)
    band = 0.004
    found = shape.signed_distance(transform_points(T, local), band)
    near = np.abs(true) < band
    assert np.abs(found - true)[near].max() < 1e-6
    np.testing.assert_array_equal(found < 0, true < 0)


def test_unit_vertices_normals_and_bounds_are_those_of_the_camera_frame(placed):
    shape, T = placed
    assert shape.unit == pytest.approx(0.05 * size_of(T))
    local = transform_points(np.linalg.inv(T), shape.vertices)
    np.testing.assert_allclose(np.abs(local).max(axis=0), HALF, atol=1e-7)
    corners = transform_points(
        T, np.array(np.meshgrid(*np.stack([-HALF, HALF], 1))).reshape(3, 8).T
    )
    np.testing.assert_allclose(shape.bounds, [corners.min(0), corners.max(0)], atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1, atol=1e-6)
    # A step along the normal of a face leads as far away from the surface.
    sides = np.flatnonzero((np.abs(local) > HALF - 1e-6).sum(axis=1) == 1)
    assert len(sides) > 20
    stepped = shape.vertices[sides] + 0.002 * shape.normals[sides]
    np.testing.assert_allclose(shape.signed_distance(stepped, 0.005), 0.002, atol=1e-6)


def test_a_wider_shape_is_softer_in_the_same_place(unmoved):
    points = around()
    sharp, soft = unmoved.logits(points), replace(unmoved, width=3 * WIDTH).logits(points)
    within = np.abs(sharp) < LIMIT
    np.testing.assert_allclose(soft[within], sharp[within] / 3, atol=1e-5)
    np.testing.assert_array_equal(sharp > 0, soft > 0)


def test_far_away_the_logit_is_at_its_limit(placed):
    shape, T = placed
    far = transform_points(T, np.array([[0.0, 0, 0], [0.5, 0, 0], [3.0, 4.0, -9.0]]))
    np.testing.assert_array_equal(shape.logits(far), [LIMIT, -LIMIT, -LIMIT])


def test_the_volume_equals_the_points(placed):
    shape, _ = placed
    axes = tuple(np.linspace(a - 0.01, b + 0.01, n) for a, b, n in zip(*shape.bounds, (4, 5, 6)))  # noqa: B905
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    volume = shape.volume(axes)
    assert volume.shape == (4, 5, 6)
    np.testing.assert_array_equal(volume.ravel(), shape.logits(nodes.reshape(-1, 3)))
