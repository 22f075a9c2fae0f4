"""Views of an object at rest join: what each saw counts once, from whichever side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import MESHES, T_CAM_WORLD, T_WORLD_CAM, K, in_camera, photograph, placed, stored

from brrp_cli.config import preset
from brrp_cli.config.tracking import SharpenConfig
from brrp_cli.geometry import similarity, transform_points, turn_about_z
from brrp_cli.methods.base import EarlierView
from brrp_cli.methods.earlier_views import EarlierViews, Guess
from brrp_cli.observation.pixel_noise import pixel_noise
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.likelihood import see
from brrp_cli.registration.model import search_model
from brrp_cli.registration.pose_covariance import pose_covariance
from brrp_cli.registration.ray_refinement import OtherRays, refine_by_rays
from brrp_cli.registration.views import SeenFrom, Views
from brrp_cli.registration.weigh import joint_log_likelihood, weigh

ID = 5
DEFAULT = preset("default").hypotheses
SENSOR = DEFAULT.sensor
# The camera stands still and the table turns: the same as a camera that goes round.
AROUND = T_CAM_WORLD @ similarity(rotation=turn_about_z(np.pi)) @ T_WORLD_CAM
NORMAL = T_CAM_WORLD[:3, 2]
TABLE = Plane(NORMAL, float(-NORMAL @ T_CAM_WORLD[:3, 3]))


def frames(name):
    """An object from one side, and from the opposite one: the second camera's frame is AROUND
    times the first one's."""
    mesh = in_camera(MESHES[name](), placed(0.0, 0.0, 0.5))
    return photograph({ID: mesh}), photograph({ID: in_camera(mesh, AROUND)})


def truth(name):
    """T_cam_object of the first of `frames`."""
    item = stored(name)
    return placed(0.0, 0.0, 0.5) @ similarity(item.half_extent, translation=item.center)


def noisy(points, seed, wave=0.0015):
    """Points along their rays, all of them off by the same `wave` besides."""
    rng = np.random.default_rng(seed)
    error = wave + 0.001 * rng.normal(size=(len(points), 1))
    return rng.permutation(points.astype(np.float64) * (1 + error / points[:, 2:]))


def test_opposite_views_end_each_others_errors_of_depth():
    """Either camera measures all depths 1.5 mm too far: alone it places the object so far behind;
    the other one errs the other way."""
    first, second = (noisy(f.object_points(ID), i) for i, f in enumerate(frames("ell")))
    shape, focal = stored("ell").shape, float(K[0, 0])

    def error(others):
        T = refine_by_rays(
            truth("ell"), shape, first, focal, TABLE, 0.001, SENSOR, DEFAULT.refine, others
        )
        vertices = shape.vertices[::10].astype(np.float64)
        moved = transform_points(T, vertices) - transform_points(truth("ell"), vertices)
        along_table = moved - np.outer(moved @ NORMAL, NORMAL)
        return np.linalg.norm(along_table, axis=1).mean()

    alone, both = error([]), error([OtherRays(second, focal, 0.001, AROUND)])
    assert alone > 0.0008 and both < alone / 3


def test_points_of_the_other_side_fix_a_pose_that_one_side_leaves_open():
    first, second = frames("box")
    model = search_model(stored("box"))
    T_cam_model = truth("box") @ np.linalg.inv(model.T_model_object)
    points = first.object_points(ID)
    behind = transform_points(np.linalg.inv(AROUND), second.object_points(ID))
    alone, both = (
        pose_covariance(T_cam_model, model, points, 0.001, SENSOR, others)
        for others in ([], [behind])
    )
    assert (np.linalg.eigvalsh(alone - both) > -1e-12).all(), "nothing is known less"
    assert np.trace(both[:3, :3]) < 0.7 * np.trace(alone[:3, :3])


@pytest.fixture(scope="module")
def seen():
    found = []
    for frame in frames("box"):
        noise = pixel_noise(frame, TABLE, SENSOR)
        found.append(see(frame, ID, TABLE, noise, SENSOR.patch, SENSOR.bleed, DEFAULT.likelihood))
    return found


def ratio(views, votes, scale=1.0):
    """Of the box where it stands, or of one `scale` times as large with the same foot."""
    model = search_model(stored("box"))
    T = truth("box") @ np.linalg.inv(model.T_model_object)
    T[:3, :3] *= scale
    every = Views(tuple(views), np.zeros((0, 3)), votes)
    return joint_log_likelihood(T, model, every, DEFAULT)


def test_ratios_of_views_add_up_and_a_weak_recognition_gets_sure_or_is_dropped(seen):
    here, there = SeenFrom(seen[0], np.eye(4)), SeenFrom(seen[1], AROUND)
    first, second = ratio([here], 1.0), ratio([there], 1.0)
    assert first > 0 and second > 0
    assert ratio([here, here], 1.0) == pytest.approx(first), "one side twice is one side"
    assert ratio([here, there], 2.0) == pytest.approx(first + second)
    assert ratio([here, there], 2.0, scale=1.3) < ratio([here], 1.0, scale=1.3) < 0

    # What is half as probable as that it is none of them.
    odds = np.log(0.5)
    before, doubled, against = (
        weigh([0.5], [odds + more], 0.5, DEFAULT.weigh)[0] for more in (0, first, -first)
    )
    assert before == pytest.approx(1 / 3) and doubled > 0.9 and against < 0.05


def views_at(*angles):
    """Of cameras at so many radians round a vertical axis through a point 1 m before the first."""
    center = np.array([0.0, 0.0, 1.0])
    found = []
    for angle in angles:
        T_now_then = np.eye(4)
        T_now_then[:3, 3] = center + [np.sin(angle), 0.0, -np.cos(angle)]
        found.append(EarlierView(T_now_then, None))
    return EarlierViews.of(found, SharpenConfig(side=0.5)), center


@pytest.mark.parametrize(
    ("angles", "votes"), [([], 1), ([0], 1), ([0.25], 1.5), ([0.5], 2), ([3], 2), ([3, 3, 1], 3)]
)
def test_views_from_one_side_are_one_vote_and_from_others_one_each(angles, votes):
    views, center = views_at(*angles)
    assert views.votes(center) == pytest.approx(votes)


def test_logits_are_averaged_over_the_views_that_thought_anything():
    values = np.full((3, 3, 3), 2.0, np.float16)
    values[2] = np.nan
    guess = Guess(np.zeros(3), 0.01, values)
    at = np.array([[0.0, 0.01, 0.01], [0.02, 0.01, 0.01], [0.5, 0.5, 0.5]])
    logits, known = guess.logits(at)
    assert known.tolist() == [True, False, False] and logits[0] == pytest.approx(2)
    shift = np.eye(4)
    shift[:3, 3] = [0.1, 0, 0]
    remembered = replace(_nothing(), guess=guess)
    views = EarlierViews.of([EarlierView(shift, remembered)], SharpenConfig())
    moved = transform_points(shift, at)
    averaged = views.averaged(np.array([-1.0, -1.0, -1.0], np.float32), moved)
    assert averaged == pytest.approx([0.5, -1, -1])


def _nothing():
    from brrp_cli.methods.earlier_views import Remembered

    none = np.zeros(0)
    return Remembered(None, ID, None, none, None, None, 0.0, none, (), {}, None, None, False)
