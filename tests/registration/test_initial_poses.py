"""Where the search begins: frames on planes, and resting poses laid over what was seen."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from table_scene import NORMAL, TABLE, box, in_camera, photograph, placed, stored

from brrp_cli.config import FeatureConfig, RegistrationConfig, SearchConfig
from brrp_cli.geometry import normalise, transform_points
from brrp_cli.observation.support_plane import Plane, plane_frame
from brrp_cli.registration.initial_poses import feature_matched_poses, resting_initial_poses
from brrp_cli.registration.model import search_model
from brrp_cli.registration.outline import outline
from brrp_cli.registration.scale_scan import observed_cloud

BOX, TURNS = 5, 12
CONFIG = SearchConfig(turns=TURNS)
FEATURES = FeatureConfig(scales=(0.4, 0.5, 0.6))


def resting(model, points):
    footprint = outline(points, TABLE, CONFIG).footprint
    return resting_initial_poses(model, footprint, CONFIG)


@pytest.fixture(scope="module")
def points():
    """Of a box that stands on the table, in random order."""
    frame = photograph({BOX: in_camera(box(), placed(0.05, -0.04, 0.3))})
    return np.random.default_rng(0).permutation(frame.object_points(BOX).astype(np.float64))


@pytest.fixture(scope="module")
def model():
    return search_model(stored("box"))


@pytest.fixture(scope="module")
def starts(model, points):
    return resting(model, points)


@pytest.mark.parametrize(
    "normal",
    [[1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 1], [-0.2, 0.9, 1e-9], [3, -4, 0.5]],
)
def test_the_plane_is_where_z_is_zero_and_z_points_along_its_normal(normal):
    plane = Plane(normalise(np.array(normal, dtype=np.float64)), 0.37)
    T = plane_frame(plane)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
    points = np.random.default_rng(0).normal(size=(50, 3))
    np.testing.assert_allclose(
        transform_points(T, points)[:, 2], plane.signed_distance(points), atol=1e-12
    )
    np.testing.assert_array_equal(plane_frame(plane), T)


def test_the_stored_model_has_its_true_size(model):
    np.testing.assert_allclose(np.ptp(model.surface, axis=0), [0.10, 0.06, 0.14], atol=1e-3)
    np.testing.assert_allclose(model.surface.mean(axis=0), 0, atol=0.005)


@pytest.fixture(scope="module")
def poses(starts):
    """The starts of one turn each: one, or one and two that are slid along the plane."""
    groups: list[list[np.ndarray]] = []
    for T in starts:
        if groups and np.allclose(groups[-1][0][:3, :3], T[:3, :3]):
            groups[-1].append(T)
        else:
            groups.append([T])
    return groups


def test_one_start_for_each_resting_pose_and_turn_and_two_where_a_part_is_hidden(model, poses):
    assert len(model.resting) == 6, "a box rests on each of its sides"
    assert len(poses) == 6 * TURNS
    assert {len(group) for group in poses} == {1, 3}


def test_every_start_is_rigid_and_stands_on_the_plane(model, starts):
    for T in starts:
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
        height = TABLE.signed_distance(transform_points(T, model.surface))
        assert height.min() == pytest.approx(0, abs=1e-3)


def test_the_starts_are_the_resting_poses_turned(poses):
    """Each side is up as often as another, and turns divide the circle evenly."""
    starts = [group[0] for group in poses]
    up = np.array([T[:3, :3].T @ NORMAL for T in starts])
    sides, counts = np.unique(up.round(6), axis=0, return_counts=True)
    assert sorted(np.abs(sides).sum(axis=1)) == [1] * 6
    assert list(counts) == [TURNS] * 6
    first = [T[:3, :3] for T in starts[:TURNS]]
    for before, after in pairwise(first):
        angle = np.arccos((np.trace(after @ before.T) - 1) / 2)
        assert angle == pytest.approx(2 * np.pi / TURNS)


def extents(T, model, direction=None):
    """Least and greatest coordinates along the plane of the model's side that faces the camera."""
    placed_points = transform_points(T, model.surface)
    facing = np.einsum("ij,ij->i", -placed_points, model.normals @ T[:3, :3].T) > 0
    front = transform_points(plane_frame(TABLE), placed_points[facing])[:, :2]
    front = front if direction is None else front @ direction
    return front.min(axis=0), front.max(axis=0)


def seen_along_plane(points):
    return transform_points(plane_frame(TABLE), points)[:, :2]


def test_the_side_that_faces_the_camera_lies_over_what_was_seen(model, points, poses):
    low, high = np.quantile(seen_along_plane(points), [0.02, 0.98], axis=0)
    for first, *_ in poses:
        # The starts look at fewer points, which reach not quite as far.
        np.testing.assert_allclose(
            np.mean(extents(first, model), axis=0), (low + high) / 2, atol=0.02
        )


def test_where_more_is_hidden_each_end_is_tried_as_the_seen_one(model, points, poses):
    seen = seen_along_plane(points)
    for first, *slid in poses:
        if not slid:
            continue
        ends = np.array([T[:3, 3] - first[:3, 3] for T in slid])
        np.testing.assert_allclose(ends[0], -ends[1], atol=1e-9)
        np.testing.assert_allclose(ends @ NORMAL, 0, atol=1e-9)
        shift = (plane_frame(TABLE)[:3, :3] @ ends[0])[:2]
        direction = normalise(shift)
        low, high = np.quantile(seen @ direction, [0.02, 0.98])
        (least, _), (_, most) = (extents(T, model, direction) for T in slid)
        np.testing.assert_allclose([least, most], [low, high], atol=0.02)


def test_a_stray_point_moves_no_start(model, points, starts):
    stray = np.concatenate([points[:1] + [0.3, 0.0, 0.2], points])
    again = resting(model, stray)
    assert len(again) == len(starts)
    np.testing.assert_allclose(again, starts, atol=2e-3)


def test_one_of_the_starts_is_near_the_truth(model, starts):
    truth = placed(0.05, -0.04, 0.3)
    true_points = transform_points(truth, model.surface + [0, 0, 0.07])

    def error(T):
        both = (transform_points(T @ np.diag([s, s, 1, 1]), model.surface) for s in (1, -1))
        return min(np.linalg.norm(found - true_points, axis=1).mean() for found in both)

    assert min(error(T) for T in starts) < 0.02


def test_without_features_to_match_the_model_stands_unturned_behind_its_front(model, points):
    observed = observed_cloud(points, FEATURES)
    starts = feature_matched_poses(model, observed, FEATURES, RegistrationConfig(), 0, 0)
    assert len(starts) == 1
    np.testing.assert_array_equal(starts[0][:3, :3], np.eye(3))
    moved = starts[0][:3, 3] - observed.center
    assert np.linalg.norm(moved) == pytest.approx((0.10 + 0.06 + 0.14) / 12, rel=0.02)
    np.testing.assert_allclose(normalise(moved), normalise(observed.center), atol=1e-9)


def test_matchings_are_rigid_and_repeat_their_seed(model, points):
    observed = observed_cloud(points, FEATURES)
    config = RegistrationConfig(iterations=2000)
    starts = feature_matched_poses(model, observed, FEATURES, config, 3, 7)
    assert 2 <= len(starts) <= 4
    for T in starts:
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-6)
    again = feature_matched_poses(model, observed, FEATURES, config, 3, 7)
    np.testing.assert_array_equal(starts, again)
