"""What looks almost alike when it is turned: the pixels choose, and what they cannot is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from table_scene import (
    MESHES,
    PARAMETERS,
    T_CAM_WORLD,
    T_WORLD_CAM,
    TABLE,
    in_camera,
    one_view,
    photograph,
    placed,
    seen_from,
    stored,
)

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import similarity, transform_points, turn_about_z
from brrp_cli.prior.build.find_meshes import MeshSource
from brrp_cli.prior.build.make_object import make_object
from brrp_cli.registration.model import search_model
from brrp_cli.registration.onto_itself import turns_onto_itself
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.turned import turned
from brrp_cli.registration.verification import Verifier
from brrp_cli.registration.views import Views
from brrp_cli.shapes import solids

CONFIG, PATCH, HERE = SearchConfig(), 0.01, np.eye(4)


def turn(yaw):
    return similarity(rotation=turn_about_z(yaw))


def seen(name, noise=0.0005, around=HERE):
    """The model, where it stands, and what the camera sees of it, with noise along the rays; the
    table was moved by `around` before."""
    model = search_model(stored(name))
    T_cam_mesh = around @ placed(0.0, 0.0, 0.4)
    frame = photograph({1: in_camera(MESHES[name](), T_cam_mesh)})
    rng = np.random.default_rng(0)
    points = rng.permutation(frame.object_points(1)).astype(np.float64)
    points *= 1 + noise * rng.normal(size=(len(points), 1))
    truth = T_cam_mesh @ similarity(translation=model.stored.center)
    return model, truth, Verifier(points, frame, TABLE)


def undecided(T_cam_model):
    """The frame does not tell placements apart, but for what the distances say."""
    return 0.0


def as_it_is(hypothesis):
    """A placement that cannot be brought nearer."""
    return hypothesis


def turned_alone(placed, verifier, judge, refine, config=CONFIG):
    """In a frame that stands alone."""
    return turned(placed, verifier, one_view(verifier), PATCH, config, judge, refine)


def apart(T, truth):
    """Radians between two placements."""
    return Rotation.from_matrix((np.linalg.inv(truth) @ T)[:3, :3]).magnitude()


def test_a_fruit_is_turned_to_where_its_dents_were_seen():
    model, truth, verifier = seen("fruit")
    wrong = truth @ similarity(rotation=Rotation.from_rotvec([0, 0, 2.0]).as_matrix())
    found = turned_alone(Hypothesis(model, wrong, 1.0, 0.9), verifier, undecided, as_it_is)
    assert apart(found.best.T_cam_model, truth) < 0.1 < apart(wrong, truth)
    assert found.best.alignment_score == 0.9
    assert not len(found.alike), "what was seen tells the others apart"


def test_what_fits_stays_as_it_is():
    model, truth, verifier = seen("fruit")
    right = Hypothesis(model, truth, 1.0, 0.9)
    assert turned_alone(right, verifier, undecided, as_it_is).best is right


def test_nothing_is_like_an_ell():
    model, truth, verifier = seen("ell")
    right = Hypothesis(model, truth, 1.0, 0.9)
    found = turned_alone(right, verifier, undecided, as_it_is)
    assert found.best is right and found.alike.shape == (0, 4, 4)


def test_a_box_may_as_well_stand_back_to_front():
    model, truth, verifier = seen("box")
    found = turned_alone(Hypothesis(model, truth, 1.0, 0.9), verifier, undecided, as_it_is)
    angles = np.array([apart(T, found.best.T_cam_model) for T in found.alike])
    assert len(angles) and (angles > 3.0).all()


def test_a_thing_that_was_scanned_askew_is_turned_end_over_end_too(tmp_path):
    """Stored meshes do not lie along the axes of their boxes; the turns that bring one back onto
    itself are found all the same."""
    askew = Rotation.from_rotvec([0.15, 0.1, 0.2]).as_matrix()
    box = solids.box(0.16, 0.10, 0.05)
    box.apply_transform(similarity(rotation=askew))
    box.export(tmp_path / "askew.ply")
    source = MeshSource("askew", tmp_path / "askew.ply", "askew.ply")
    model = search_model(make_object(source, PARAMETERS))
    found = turns_onto_itself(model, CONFIG.about_itself)
    halves = Rotation.from_matrix(found[:, :3, :3])
    halves = halves[np.abs(halves.magnitude() - np.pi) < 0.05]
    axes = np.abs(halves.as_rotvec() @ askew) / np.pi
    for axis in np.eye(3):
        assert np.abs(axes - axis).max(axis=1).min() < 0.05, axis


def test_a_handle_is_where_an_earlier_view_saw_it():
    """Hidden behind the mug it may as well be anywhere there."""
    model, _, earlier = seen("mug")
    around = T_CAM_WORLD @ turn(np.pi) @ T_WORLD_CAM
    _, truth, behind = seen("mug", around=around)
    points = transform_points(around, earlier.points)
    points = np.random.default_rng(0).permutation(np.concatenate([behind.points, points]))
    here = seen_from(behind.frame, np.eye(4))
    there = seen_from(earlier.frame, np.linalg.inv(around))
    mug = Hypothesis(model, truth, 1.0, 0.9)
    assert len(turned_alone(mug, behind, undecided, as_it_is).alike)
    both = Views((here, there), points, 2.0)
    found = turned(mug, behind, both, PATCH, CONFIG, undecided, as_it_is)
    assert apart(found.best.T_cam_model, truth) < 0.1 and not len(found.alike)
    aside = Hypothesis(model, truth @ turn(0.5), 1.0, 0.9)
    found = turned(aside, behind, both, PATCH, CONFIG, undecided, as_it_is)
    assert apart(found.best.T_cam_model, truth) < 0.1


def test_what_the_frame_speaks_against_is_not_as_probable():
    """Colours, or a silhouette, know more than distances."""
    model, truth, verifier = seen("box")

    def judge(T_cam_model):
        return -5.0 * (apart(T_cam_model, truth) > 3.0)

    box = Hypothesis(model, truth, 1.0, 0.9)
    assert len(turned_alone(box, verifier, undecided, as_it_is).alike)
    assert not len(turned_alone(box, verifier, judge, as_it_is).alike)


def test_the_most_probable_of_those_alike_takes_the_place_of_the_first():
    model, truth, verifier = seen("box")

    def judge(T_cam_model):
        return float(apart(T_cam_model, truth) < 0.1)

    back_to_front = truth @ similarity(rotation=Rotation.from_rotvec([0, 0, np.pi]).as_matrix())
    first = Hypothesis(model, back_to_front, 1.0, 0.9)
    found = turned_alone(first, verifier, judge, as_it_is)
    assert apart(found.best.T_cam_model, truth) < 0.1
    assert any(np.array_equal(each, back_to_front) for each in found.alike)


def test_what_is_no_more_probable_by_far_does_not_take_the_place_of_an_earlier_pose():
    """From frame to frame a box is not to jump back to front: both are told in each."""
    model, truth, verifier = seen("box")
    back_to_front = truth @ turn(np.pi)
    placed, views = Hypothesis(model, back_to_front, 1.0, 0.9), one_view(verifier)

    def judge(T_cam_model):
        return float(apart(T_cam_model, truth) < 0.1)

    def found(steady):
        return turned(placed, verifier, views, PATCH, CONFIG, judge, as_it_is, steady)

    assert apart(found(0.5).best.T_cam_model, truth) < 0.1
    kept = found(1.5)
    assert kept.best is placed
    assert any(apart(each, truth) < 0.1 for each in kept.alike)


def test_depth_alone_does_not_turn_what_is_then_less_probable():
    model, truth, verifier = seen("fruit")
    wrong = Hypothesis(model, truth @ turn(2.0), 1.0, 0.9)

    def judge(T_cam_model):
        return float(apart(T_cam_model, truth) > 0.5)

    assert turned_alone(wrong, verifier, judge, as_it_is).best is wrong


def test_the_result_is_as_near_as_what_was_given():
    model, truth, verifier = seen("fruit")
    wrong = truth @ similarity(rotation=Rotation.from_rotvec([0, 0, 2.0]).as_matrix())

    def refine(hypothesis):
        return replace(hypothesis, T_cam_model=truth)

    found = turned_alone(Hypothesis(model, wrong, 1.0, 0.9), verifier, undecided, refine)
    assert np.array_equal(found.best.T_cam_model, truth)


def test_one_that_is_not_quite_there_is_brought_nearer_before_it_is_judged():
    model, truth, verifier = seen("box")
    exact = truth @ similarity(rotation=Rotation.from_rotvec([0, 0, np.pi]).as_matrix())

    def judge(T_cam_model):
        right = np.array_equal(T_cam_model, truth) or np.array_equal(T_cam_model, exact)
        return 0.0 if right else -5.0

    def refine(hypothesis):
        return replace(hypothesis, T_cam_model=exact)

    box = Hypothesis(model, truth, 1.0, 0.9)
    assert not len(turned_alone(box, verifier, judge, as_it_is).alike)
    found = turned_alone(box, verifier, judge, refine)
    assert found.best is box
    assert len(found.alike) and all(np.array_equal(each, exact) for each in found.alike)
    few = replace(CONFIG, about_itself=replace(CONFIG.about_itself, refined_nats=2.0))
    assert not len(turned_alone(box, verifier, judge, refine, few).alike)
