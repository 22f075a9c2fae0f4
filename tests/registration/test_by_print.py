"""A placed object is turned as its print lies in the image, where depth leaves that open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from printed_model import painted, printed, turn
from scipy.spatial.transform import Rotation
from table_scene import (
    T_CAM_WORLD,
    T_WORLD_CAM,
    one_view,
    seen_from,
)

from brrp_cli.config import SearchConfig, SensorConfig
from brrp_cli.geometry import transform_points
from brrp_cli.registration.by_print import print_nats, turned_by_print
from brrp_cli.registration.pose_covariance import pose_covariance
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.views import Views

CONFIG, PATCH, WAVE = SearchConfig(), 0.01, 0.0005
OPEN = SensorConfig(pose_turn=CONFIG.by_print.turn, pose_shift=CONFIG.by_print.shift)


def found(model, T, verifier, config=CONFIG, judge=lambda T: 0.0, views=None):
    """What a placement becomes; depth is brought no nearer."""

    def covariance(T_cam_model):
        return pose_covariance(T_cam_model, model, verifier.points, WAVE, OPEN)

    return turned_by_print(
        Hypothesis(model, T, 1.0, 0.9),
        views or one_view(verifier),
        PATCH,
        config,
        judge,
        lambda each: each,
        covariance,
    ).T_cam_model


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


AROUND = T_CAM_WORLD @ turn(0, 0, 2.0) @ T_WORLD_CAM  # like a camera that goes round


def grey(frame):
    return replace(frame, rgb=np.full_like(frame.rgb, 120))


@pytest.mark.parametrize("votes", [1.0, 2.0])
def test_what_an_earlier_view_showed_of_the_print_turns_it(votes):
    """The present one has no colours to tell by; from the other side they were seen."""
    model, truth, verifier = painted("ball")
    _, _, earlier = painted("ball", around=AROUND)
    plain = replace(verifier, frame=grey(verifier.frame))
    here, there = seen_from(plain.frame, np.eye(4)), seen_from(earlier.frame, AROUND)
    back = transform_points(np.linalg.inv(AROUND), earlier.points)
    points = np.random.default_rng(0).permutation(np.concatenate([plain.points, back]))
    off = truth @ turn(0.1, 0, 0.1)
    assert np.array_equal(found(model, off, plain), off)
    T = found(model, off, plain, views=Views((here, there), points, votes))
    assert degrees(T, truth) < 2 < 5 < degrees(off, truth)


def test_without_print_nothing_moves():
    model, truth, verifier = painted("ball")
    off = truth @ turn(0, 0, 0.1)
    one = np.full_like(model.stored.shape.colours, 120)
    plain = replace(model.stored, shape=replace(model.stored.shape, colours=one))
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
