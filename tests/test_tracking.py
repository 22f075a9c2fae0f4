"""A stream of frames: ids stay, what has not moved costs nothing, what has moved is done again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from sphere_method import METHOD, Sphere
from table_scene import SHAPE, K, in_camera

from brrp_cli import Reconstructor
from brrp_cli.config.tracking import SharpenConfig, TrackConfig
from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.methods import base
from brrp_cli.methods.registry import METHODS
from brrp_cli.raycast import look
from brrp_cli.reconstruction import OK, ObjectReconstruction
from brrp_cli.shapes import solids
from brrp_cli.tracking import tracker
from brrp_cli.tracking.followed import first_frame, follow
from brrp_cli.tracking.motion import at_rest, camera_motion, spread_out

RED, GREEN, BLUE = (200, 60, 50), (60, 180, 70), (60, 80, 200)
YAW = 0.4


def scene(places, *, yaw=YAW, tilt=0.7, noise=0.0, seed=0, known=False) -> Frame:
    """Boxes {colour: (x, y)} on a table from a camera that stands at `yaw`; ids from left to right
    in the image, as masks get them."""
    T_world_cam = camera_pose(np.array([0.0, 0.0, 0.03]), 0.7, tilt, yaw)
    T_cam_world = np.linalg.inv(T_world_cam)
    boxes = [
        in_camera(solids.moved(solids.box(0.06, 0.06, 0.09), x=x, y=y), T_cam_world)
        for x, y in places.values()
    ]
    slab = in_camera(solids.moved(solids.box(1.4, 1.4, 0.02), z=-0.02), T_cam_world)
    sight = look([*boxes, slab], K, SHAPE)
    rng = np.random.default_rng(seed)
    depth = sight.depth + noise * rng.normal(size=SHAPE)
    rgb = np.full((*SHAPE, 3), 128, np.uint8)
    middles = {}
    for number, colour in enumerate(places):
        rgb[sight.index == number] = colour
        middles[number] = np.nonzero(sight.index == number)[1].mean()
    ids = np.zeros(SHAPE, np.int64)
    for place, number in enumerate(sorted(middles, key=lambda n: middles[n]), start=1):
        ids[sight.index == number] = place
    return Frame(rgb, backproject(depth, K), ids, K, T_world_cam if known else None)


def colour_of(frame: Frame, object_id: int) -> tuple[int, ...]:
    return tuple(int(c) for c in np.median(frame.rgb[frame.segmap == object_id], axis=0))


@pytest.fixture
def inferred(monkeypatch):
    """The sphere method, object by object, and the ids that it was asked for, call by call."""
    asked: list[list[int]] = []

    def run(frame, setup: base.Setup):
        segmap = np.where(np.isin(frame.segmap, list(setup.only)), frame.segmap, 0)
        asked.append(sorted(setup.only))
        return replace(METHOD.run(replace(frame, segmap=segmap), setup), frame=frame)

    monkeypatch.setitem(METHODS, "sphere", replace(METHOD, run=run))
    return asked


A, B, C = (-0.1, 0.12), (0.1, 0.0), (-0.05, -0.15)
START = {RED: A, GREEN: B, BLUE: C}


@pytest.mark.parametrize("noise", [0.0, 0.0015])
def test_what_has_not_moved_is_not_inferred_again_and_what_has_is(noise, inferred):
    session = Reconstructor(method="sphere", track=True)
    first = session(scene(START, noise=noise))
    ids = {colour_of(first.frame, i): i for i in first.frame.object_ids}
    assert inferred == [[1, 2, 3]]
    for seed in (1, 2):
        again = session(scene(START, noise=noise, seed=seed))
        assert [o.object_id for o in again.objects] == [1, 2, 3]
    assert inferred == [[1, 2, 3]], "three frames of what stands are one"
    assert again.objects[0].posterior is first.objects[0].posterior
    assert again.objects[0].seconds == {} and again.seconds["tracking"] > 0

    # One is moved to the other side of the others: its id goes along, and it alone is done again.
    moved = session(scene(START | {GREEN: (0.12, 0.13)}, noise=noise, seed=3))
    assert {colour_of(moved.frame, i): i for i in moved.frame.object_ids} == ids
    assert inferred[1:] == [[ids[GREEN]]]
    posterior = next(o for o in moved.objects if o.object_id == ids[GREEN]).posterior
    assert isinstance(posterior, Sphere)
    T_cam_world = np.linalg.inv(camera_pose(np.array([0.0, 0.0, 0.03]), 0.7, 0.7, YAW))
    there = T_cam_world[:3, :3] @ [0.12, 0.13, 0.045] + T_cam_world[:3, 3]
    assert posterior.center == pytest.approx(there, abs=0.03)
    assert [o.object_id for o in moved.objects] == [1, 2, 3]


def test_what_creeps_is_found_in_the_end(inferred):
    """Half a millimetre a frame is less than noise: it is held to what it was inferred from."""
    session = Reconstructor(method="sphere", track=True)
    for step in range(16):
        session(scene(START | {GREEN: (0.1 - 0.0005 * step, 0.0)}))
    assert 2 <= len(inferred) <= 8 and len({tuple(each) for each in inferred[1:]}) == 1


@pytest.mark.parametrize("known", [True, False], ids=["pose known", "pose unknown"])
def test_ids_stay_while_the_camera_goes_round(known, inferred):
    """Masks are numbered from left to right: going round, their order changes."""
    session = Reconstructor(method="sphere", track=True)
    by_colour, orders = [], set()
    for yaw in np.arange(0.4, 2.5, 0.2):
        seen = scene(START, yaw=yaw, known=known)
        orders.add(tuple(colour_of(seen, i) for i in seen.object_ids))
        result = session(seen)
        by_colour.append({colour_of(result.frame, i): i for i in result.frame.object_ids})
    assert len(orders) > 1, "the order of the masks changes on the way"
    assert all(each == by_colour[0] for each in by_colour)
    assert all(each == [1, 2, 3] for each in inferred), "the camera has moved: all are done again"


def test_what_comes_gets_a_new_id_and_what_went_leaves_its_own_behind(inferred):
    session = Reconstructor(method="sphere", track=True)
    ids = {colour_of(r.frame, i): i for r in [session(scene(START))] for i in r.frame.object_ids}
    gone = session(scene({RED: A, GREEN: B}))
    assert {colour_of(gone.frame, i): i for i in gone.frame.object_ids} == {
        RED: ids[RED], GREEN: ids[GREEN]
    }  # fmt: skip
    new = session(scene({RED: A, GREEN: B, (220, 210, 60): C}))
    assert sorted(new.frame.object_ids) == sorted([ids[RED], ids[GREEN], 4])


def test_without_tracking_every_frame_stands_alone(inferred, monkeypatch):
    monkeypatch.setitem(METHODS, "sphere", METHOD)
    session = Reconstructor(method="sphere")
    first, second = session(scene(START)), session(scene(START))
    assert first.objects[0].posterior is not second.objects[0].posterior
    assert "tracking" not in second.seconds


def test_the_cameras_motion_is_that_of_its_poses_or_none_where_nobody_knows():
    config = TrackConfig()
    here, there = scene(START, known=True), scene(START, yaw=0.6, known=True)
    T = camera_motion(here, there, config)
    expected = np.linalg.inv(there.T_world_cam) @ here.T_world_cam
    assert pytest.approx(expected) == T
    blind, tilted = scene(START), scene(START, tilt=0.8)
    assert camera_motion(blind, tilted, config) is None
    assert pytest.approx(np.eye(4)) == camera_motion(blind, scene(START, noise=0.001), config)
    followed = follow(first_frame(here), there, config)
    assert followed.next_id == 4


@dataclass(frozen=True)
class Noted:
    """What the test's method remembers of an object: the frame's yaw."""

    yaw: float
    alone: bool = False


@pytest.fixture
def earlier(inferred, monkeypatch):
    """Like `inferred`, of a method that remembers; the streams it was given, call by call."""
    given: list[base.Stream | None] = []
    method = METHODS["sphere"]

    def run(frame, setup: base.Setup):
        given.append(setup.stream)
        result = method.run(frame, setup)
        for item in result.objects:
            item.memory = Noted(float(np.arctan2(*frame.T_world_cam[1::-1, 3])))
        return result

    monkeypatch.setitem(METHODS, "sphere", replace(method, run=run))
    return given


def test_an_object_at_rest_is_remembered_and_one_that_moved_forgotten(earlier):
    config = TrackConfig(sharpen=SharpenConfig(views=3), glide=None)
    session = Reconstructor(method="sphere", track=config)
    first = session(scene(START, yaw=0.4, known=True))
    assert earlier[0].earlier == {}
    assert all(isinstance(o, ObjectReconstruction) and o.memory is None for o in first.objects)
    ids = {colour_of(first.frame, i): i for i in first.frame.object_ids}
    session(scene(START, yaw=0.5, known=True))
    session(scene(START, yaw=0.9, known=True))
    views = earlier[2].earlier[ids[RED]]
    assert [v.memory.yaw for v in views] == pytest.approx([0.4, 0.5])
    here, then = (camera_pose(np.array([0.0, 0.0, 0.03]), 0.7, 0.7, yaw) for yaw in (0.9, 0.4))
    assert pytest.approx(np.linalg.inv(here) @ then) == views[0].T_now_then

    moved = START | {GREEN: (0.12, 0.05)}
    session(scene(moved, yaw=1.0, known=True))
    assert earlier[3].earlier[ids[GREEN]] == ()
    assert [v.memory.yaw for v in earlier[3].earlier[ids[RED]]] == pytest.approx([0.4, 0.5, 0.9])
    session(scene(moved, yaw=1.3, known=True))
    assert [v.memory.yaw for v in earlier[4].earlier[ids[GREEN]]] == pytest.approx([1.0])
    # Of 0.4 and 0.5, which are next to each other, the older one has made room for 1.0.
    assert [v.memory.yaw for v in earlier[4].earlier[ids[RED]]] == pytest.approx([0.5, 0.9, 1.0])


def test_nothing_is_remembered_where_nobody_asks_for_it(earlier):
    session = Reconstructor(method="sphere", track=TrackConfig(sharpen=None))
    for yaw in (0.4, 0.6):
        session(scene(START, yaw=yaw, known=True))
    assert earlier == [None, None]


def test_what_is_seen_from_its_other_side_is_at_rest_and_what_was_pushed_is_not():
    config = SharpenConfig()
    before = scene(START, yaw=0.4, known=True)
    after = scene(START | {GREEN: (0.12, 0.0)}, yaw=0.4 + np.pi, known=True)
    T = camera_motion(before, after, TrackConfig())
    after = follow(first_frame(before), after, TrackConfig()).frame
    ids = {colour_of(before, i): i for i in before.object_ids}
    assert {colour_of(after, i): i for i in after.object_ids} == ids
    assert at_rest(before, after, T, ids[RED], config)
    assert at_rest(before, after, T, ids[BLUE], config)
    assert not at_rest(before, after, T, ids[GREEN], config), "2 cm to the side"


def test_of_many_views_those_from_the_most_different_sides_are_kept():
    angles = np.array([0.0, 1.0, 1.1, 2.0, 3.0])
    directions = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    assert spread_out(directions, 4) == [0, 2, 3, 4]
    assert spread_out(directions, 5) == [0, 1, 2, 3, 4]
    assert spread_out(directions[:0], 3) == []


def test_a_view_whose_camera_is_not_known_is_not_kept(monkeypatch):
    """Names stand for frames and for what is remembered of them."""
    moved = {name: np.eye(4) for name in ("right", "left", "above")}
    for name, place in (("right", (1, 0, 0)), ("left", (-1, 0, 0)), ("above", (0, -1, 0))):
        moved[name][:3, 3] = place
    monkeypatch.setattr(tracker, "camera_motion", lambda then, now, config: moved.get(then))
    memory = SimpleNamespace(alone=False)
    item = ObjectReconstruction(7, OK, center=np.array([0, 0, 1.0]), memory=memory)
    found = tracker.Tracker(TrackConfig(), 0.1)
    found._seen[7] = [(name, name) for name in ("lost", "right", "left", "above")]
    found._remember("now", [item], SharpenConfig(views=3))
    assert found._seen[7] == [("left", "left"), ("above", "above"), ("now", memory)]
