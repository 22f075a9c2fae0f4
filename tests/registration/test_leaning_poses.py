"""The poses that resting ones do not reach."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from table_scene import T_CAM_WORLD, TABLE, box, stored, verifier_of

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.initial_poses import resting_initial_poses
from brrp_cli.registration.leaning_poses import (
    principal_poses,
    raised_poses,
    spread_rotations,
    turned_poses,
)
from brrp_cli.registration.model import search_model
from brrp_cli.registration.outline import outline

CONFIG = SearchConfig()
WHOLE = SearchConfig(box_points=10**6)


@pytest.fixture(scope="module")
def models():
    return [search_model(stored(name)) for name in ("box", "ell")]


def test_principal_axes_give_the_pose_of_a_whole_surface(models):
    model = models[0]
    T_cam_model = np.eye(4)
    T_cam_model[:3, :3] = Rotation.from_euler("xyz", [0.4, -1.1, 2.0]).as_matrix()
    T_cam_model[:3, 3] = 0.1, -0.2, 0.8
    surface = transform_points(T_cam_model, model.surface)
    found = principal_poses(model, outline(surface, None, WHOLE))
    assert found.shape == (24, 4, 4)
    np.testing.assert_allclose(np.linalg.det(found[:, :3, :3]), 1)
    assert np.abs(found - T_cam_model).max(axis=(1, 2)).min() < 1e-6


def test_raised_poses_reach_the_top_of_what_is_seen(models):
    where = T_CAM_WORLD @ similarity(translation=np.array([0.05, -0.04, 0.09]))
    verifier = verifier_of(box(), where)
    footprint = verifier.outline(CONFIG).footprint
    resting = resting_initial_poses(models[0], footprint, CONFIG)
    raised = raised_poses(resting, models[0], footprint, CONFIG)
    assert len(raised)
    top = np.quantile(TABLE.signed_distance(verifier.points), 1 - CONFIG.stray)
    for T in raised:
        height = TABLE.signed_distance(transform_points(T, models[0].surface)).max()
        assert height == pytest.approx(top, abs=1e-9)


def test_rotations_are_spread_over_all_of_them():
    spread = spread_rotations(200)
    np.testing.assert_allclose(
        spread @ spread.swapaxes(1, 2), np.tile(np.eye(3), (200, 1, 1)), atol=1e-9
    )
    wanted = Rotation.random(300, rng=0).as_matrix()
    cosine = (np.einsum("aij,bij->ab", wanted, spread) - 1) / 2
    # 200 balls of the mean radius cover all rotations only if they do not overlap much.
    assert np.degrees(np.arccos(cosine.max(axis=1))).max() < 45


def test_a_turned_model_lies_over_what_is_seen(models):
    """The side that faces the camera, and no other, has the box of the seen points."""
    where = T_CAM_WORLD @ similarity(translation=np.array([0.05, -0.04, 0.2]))
    verifier = verifier_of(box(), where)
    poses = turned_poses(
        spread_rotations(CONFIG.rotations), models[0], verifier.outline(CONFIG), CONFIG
    )
    assert len(poses) == CONFIG.rotations
    turn = np.einsum("bij,ij->b", poses[:, :3, :3], where[:3, :3])
    nearest = poses[int(turn.argmax())]
    # The turn is off by up to 30 degrees, which moves an object of 10 cm by a few of them.
    middle = transform_points(where, models[0].stored.center)
    assert np.linalg.norm(nearest[:3, 3] - middle) < 0.03
