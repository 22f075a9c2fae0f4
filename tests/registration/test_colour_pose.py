"""Colour tells apart what depth cannot: a box that is turned about itself."""

from dataclasses import replace

import numpy as np
import pytest
from table_scene import MESHES, TABLE, in_camera, photograph, placed, stored

from brrp_cli.config import ColourConfig, SearchConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.colour_pose import colour_agreement, turned_about_itself
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_search import Hypothesis, by_colour
from brrp_cli.registration.verification import Verifier

CONFIG = ColourConfig()


def test_turns_hold_the_placement_itself_and_keep_its_middle() -> None:
    T = similarity(rotation=np.eye(3), translation=np.array([0.1, 0.2, 0.9]))
    found = turned_about_itself(T, 8)
    np.testing.assert_array_equal(found[0], T)
    np.testing.assert_allclose(found[:, :3, 3], np.tile(T[:3, 3], (len(found), 1)))
    np.testing.assert_allclose(np.linalg.det(found[:, :3, :3]), 1)
    # Upside down is among them.
    assert any(np.allclose(each[:3, :3], np.diag([1, -1, -1])) for each in found)


@pytest.fixture(scope="module")
def scene():
    """A stored box that is red at one end and blue at the other, where it stands, and the image
    that shows it so in other light."""
    model = search_model(stored("box"))
    shape = model.stored.shape
    ends = np.where(shape.vertices[:, :1] > 0, [[200, 30, 30]], [[30, 30, 200]]).astype(np.uint8)
    model = replace(model, stored=replace(model.stored, shape=replace(shape, colours=ends)))
    T_cam_mesh = placed(0.0, 0.0, 0.4)
    T = T_cam_mesh @ similarity(translation=model.stored.center)
    frame = photograph({1: in_camera(MESHES["box"](), T_cam_mesh)})
    local = transform_points(np.linalg.inv(T), np.nan_to_num(frame.points.reshape(-1, 3)))
    rgb = np.where(local[:, :1] > 0, [[150, 60, 90]], [[60, 60, 170]]).astype(np.uint8)
    return model, T, replace(frame, rgb=rgb.reshape(frame.rgb.shape))


def test_the_colours_agree_where_the_box_stands_as_it_is_stored(scene) -> None:
    model, T, frame = scene
    back_to_front = T @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    assert colour_agreement(T, model, frame, CONFIG) > 0.8
    assert colour_agreement(back_to_front, model, frame, CONFIG) < -0.8


def test_one_colour_tells_nothing(scene) -> None:
    model, T, frame = scene
    shape = replace(model.stored.shape, colours=np.full_like(model.stored.shape.colours, 90))
    plain = replace(model, stored=replace(model.stored, shape=shape))
    assert colour_agreement(T, plain, frame, CONFIG) == 0


def test_the_search_turns_a_box_round_by_its_colours(scene) -> None:
    model, T, frame = scene
    back_to_front = T @ similarity(rotation=np.diag([-1.0, -1.0, 1.0]))
    points = np.random.default_rng(0).permutation(frame.object_points(1)).astype(np.float64)
    record = {**model.stored.record, "coloured": True}
    model = replace(model, stored=replace(model.stored, record=record))
    best = Hypothesis(model, back_to_front, 1.0, 0.95)
    found = by_colour(best, Verifier(points, frame, TABLE), SearchConfig())
    # Upside down the box is the same, in colour too.
    np.testing.assert_allclose(found.T_cam_model[:3, [0, 3]], T[:3, [0, 3]], atol=2e-3)
    assert found.alignment_score == best.alignment_score
