"""A placed object is turned as its print lies in the image, where depth leaves that open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from table_scene import MESHES, TABLE, in_camera, photograph, placed, stored

from brrp_cli.config import SearchConfig, SensorConfig
from brrp_cli.geometry import similarity, transform_points
from brrp_cli.registration.by_print import print_nats, turned_by_print
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_covariance import pose_covariance
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.verification import Verifier

CONFIG, PATCH, WAVE = SearchConfig(), 0.01, 0.0005
OPEN = SensorConfig(pose_turn=CONFIG.by_print.turn, pose_shift=CONFIG.by_print.shift)


def printed(points, size):
    """Colours (n, 3) of points (n, 3) on an object: bands and spots that no turn maps to
    themselves."""
    x, y, z = points.T / size
    bands = np.stack([np.sin(4 * x + z), np.sin(5 * y + 1 + x), np.cos(4 * z + 2 * x * y)], axis=-1)
    return (128 + 100 * bands).astype(np.uint8)


def painted(name, light=1.0, noise=0.0):
    """The model with print on it, where it stands, and a frame that shows it in other light, with
    noise, of 255."""
    model = search_model(stored(name))
    shape, unit = model.stored.shape, model.stored.half_extent
    colours = printed(shape.vertices * unit, unit)
    record = {**model.stored.record, "coloured": True}
    own = replace(model.stored, shape=replace(shape, colours=colours), record=record)
    model = replace(model, stored=own)
    T_cam_mesh = placed(0.0, 0.0, 0.4)
    truth = T_cam_mesh @ similarity(translation=own.center)
    frame = photograph({1: in_camera(MESHES[name](), T_cam_mesh)})
    local = transform_points(np.linalg.inv(truth), np.nan_to_num(frame.points.reshape(-1, 3)))
    rgb = (printed(local, unit) * light).reshape(frame.rgb.shape)
    rgb = np.clip(rgb + np.random.default_rng(1).normal(0, noise, rgb.shape), 0, 255)
    frame = replace(frame, rgb=np.where(frame.segmap[..., None] == 1, rgb, 90).astype(np.uint8))
    points = np.random.default_rng(0).permutation(frame.object_points(1)).astype(np.float64)
    return model, truth, Verifier(points, frame, TABLE)


def found(model, T, verifier, config=CONFIG, judge=lambda T: 0.0):
    """What a placement becomes; depth is brought no nearer."""

    def covariance(T_cam_model):
        return pose_covariance(T_cam_model, model, verifier.points, WAVE, OPEN)

    return turned_by_print(
        Hypothesis(model, T, 1.0, 0.9),
        verifier,
        PATCH,
        config,
        judge,
        lambda each: each,
        covariance,
    ).T_cam_model


def turn(*rotvec):
    return similarity(rotation=Rotation.from_rotvec(rotvec).as_matrix())


def degrees(T, truth):
    return np.degrees(Rotation.from_matrix((np.linalg.inv(truth) @ T)[:3, :3]).magnitude())


@pytest.mark.parametrize("light", [1.0, 0.5])
@pytest.mark.parametrize("off", [(0, 0, 0.1), (0.15, -0.1, 0.1)])
def test_a_ball_is_turned_to_where_its_print_is_seen(off, light):
    model, truth, verifier = painted("ball", light)
    T = found(model, truth @ turn(*off), verifier)
    assert degrees(T, truth) < 2 < 5 < degrees(truth @ turn(*off), truth)
    np.testing.assert_allclose(T[:3, 3], truth[:3, 3], atol=0.0005)


def test_a_ball_that_is_turned_far_is_turned_back():
    """By turns that bring it onto itself, which are drawn at random: near one of them."""
    model, truth, verifier = painted("ball")
    T = found(model, truth @ turn(0, 0, 2.5), verifier)
    assert degrees(T, truth) < 5


def test_a_box_is_turned_back_to_front_but_else_stays_where_depth_has_it():
    model, truth, verifier = painted("box")
    np.testing.assert_allclose(found(model, truth, verifier), truth, atol=1e-9)
    T = found(model, truth @ turn(0, 0, np.pi), verifier)
    assert degrees(T, truth) < 1


def test_depth_and_the_rest_of_the_frame_have_their_say():
    model, truth, verifier = painted("box")
    wrong = truth @ turn(0, 0, np.pi)

    def judge(T_cam_model):
        return -1000.0 * (degrees(T_cam_model, wrong) > 90)

    np.testing.assert_allclose(found(model, wrong, verifier, judge=judge), wrong, atol=1e-9)


def test_what_lies_further_from_the_points_is_not_taken_for_a_better_print():
    """A fruit with dents of 2 mm, whose print was stored turned by half a turn."""
    model, truth, verifier = painted("fruit", noise=100.0)
    shape = model.stored.shape
    round_the_back = transform_points(turn(0, 0, np.pi), shape.vertices.astype(np.float64))
    unit = model.stored.half_extent
    colours = printed(round_the_back * unit, unit)
    own = replace(model.stored, shape=replace(shape, colours=colours))
    model = replace(model, stored=own)
    assert degrees(found(model, truth, verifier), truth) < 20


def test_without_print_nothing_moves():
    model, truth, verifier = painted("ball")
    off = truth @ turn(0, 0, 0.1)
    grey = np.full_like(model.stored.shape.colours, 120)
    plain = replace(model.stored, shape=replace(model.stored.shape, colours=grey))
    assert np.array_equal(found(replace(model, stored=plain), off, verifier), off)
    bare = replace(model.stored, record={**model.stored.record, "coloured": False})
    assert np.array_equal(found(replace(model, stored=bare), off, verifier), off)
    unasked = replace(CONFIG, by_print=replace(CONFIG.by_print, asked=False))
    assert np.array_equal(found(model, off, verifier, unasked), off)


def test_the_nats_of_a_print_are_those_of_a_line_through_its_colours():
    """-n/2 ln(1 - r^2), none for colours that are reversed."""
    model, truth, verifier = painted("ball")
    frame = verifier.frame
    reverse = replace(frame, rgb=(255 - frame.rgb).astype(np.uint8))
    nats = print_nats(truth[None], model, frame, CONFIG, None)[0]
    own = CONFIG.by_print
    cells = nats / (-0.5 * own.independent * np.log(1 - own.most_alike**2))
    assert print_nats(truth[None], model, reverse, CONFIG, None)[0] == 0
    # Half of the ball faces the camera, in cells of 6 mm: at most 2 pi r^2 / cell^2 and some more.
    assert 100 < cells < 2 * 2 * np.pi * 0.05**2 / own.cell**2
