"""What is seen, measured along its plane and before the camera, against boxes of known sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import transform_points
from brrp_cli.observation.support_plane import Plane, plane_frame
from brrp_cli.registration.outline import outline, principal_axes

WHOLE = SearchConfig(box_points=10**6, stray=0.0)
# 0.7 m ahead of a camera that looks down at an angle.
PLANE = Plane(normal=np.array([0.0, -0.8, -0.6]), offset=0.42)
SIDES = np.array([0.12, 0.08, 0.05])
TURN = 0.3


def standing(at=(0.06, -0.03)):
    """The corners of a box of `SIDES` that stands on the plane, camera frame, and the way there."""
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), -1).reshape(-1, 3) * SIDES
    turned = corners @ Rotation.from_rotvec([0, 0, TURN]).as_matrix().T
    turned += [*at, SIDES[2] / 2]
    T_cam_plane = np.linalg.inv(plane_frame(PLANE))
    return transform_points(T_cam_plane, turned)


def test_the_plane_is_where_it_is_meant_to_be():
    heights = PLANE.signed_distance(standing())
    assert heights.min() == pytest.approx(0, abs=1e-9)
    assert heights.max() == pytest.approx(SIDES[2])


def test_a_box_reaches_as_far_as_its_sides():
    found = outline(standing(), PLANE, WHOLE).footprint
    assert found.top == pytest.approx(SIDES[2])
    assert found.middle == pytest.approx([0.06, -0.03])
    angles = np.arange(0, 2 * np.pi, 0.01)
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    expected = np.abs(np.cos(angles - TURN)) * SIDES[0] + np.abs(np.sin(angles - TURN)) * SIDES[1]
    # Straight between two directions, which cuts the kink at a right angle to a side.
    apart = np.pi / WHOLE.directions
    assert found.extent(ways) == pytest.approx(expected, abs=SIDES[0] * apart / 2)
    assert np.median(np.abs(found.extent(ways) - expected)) < SIDES[0] * apart**2


def test_strays_do_not_count():
    rng = np.random.default_rng(0)
    many = np.tile(standing(), (60, 1))
    strays = many.mean(axis=0) + rng.uniform(0.2, 0.4, (2, 3))
    points = rng.permutation(np.concatenate([many, strays]))
    clean = outline(many, PLANE, WHOLE)
    found = outline(points, PLANE, SearchConfig(box_points=10**6, stray=0.02))
    assert found.footprint.extents == pytest.approx(clean.footprint.extents)
    assert found.footprint.top == pytest.approx(SIDES[2])


def test_before_the_camera_it_is_measured_across_the_line_of_sight():
    points = standing()
    found = outline(points, None, WHOLE)
    assert found.footprint is None
    np.testing.assert_allclose(found.T_sight_cam @ found.T_sight_cam.T, np.eye(3), atol=1e-12)
    ahead = points.mean(axis=0)
    assert found.T_sight_cam[2] == pytest.approx(ahead / np.linalg.norm(ahead))
    seen = points @ found.T_sight_cam.T
    assert found.low == pytest.approx(seen.min(axis=0))
    assert found.high == pytest.approx(seen.max(axis=0))


def test_principal_axes_are_a_box_s_own():
    turn = Rotation.from_euler("xyz", [0.4, -1.1, 2.0]).as_matrix()
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    axes = principal_axes(grid * SIDES @ turn.T)
    assert np.linalg.det(axes) == pytest.approx(1)
    # The shortest first.
    assert np.abs(axes.T @ turn[:, ::-1]) == pytest.approx(np.eye(3), abs=1e-9)
