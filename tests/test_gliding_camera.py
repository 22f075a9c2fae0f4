"""Before a camera that moves a little, masks and results of an earlier frame hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sphere_method import Sphere
from test_tracking import BLUE, GREEN, RED, START, YAW, A, scene
from test_tracking import inferred as inferred
from test_unchanged_view import bare, by_colour
from test_unchanged_view import made as made

from brrp_cli import Reconstructor
from brrp_cli.config.tracking import TrackConfig
from brrp_cli.geometry import inverse, similarity, transform_points, turn_about_z
from brrp_cli.observation.support_plane import Plane
from brrp_cli.reconstruction import Retrieved
from brrp_cli.tracking.glided import glided
from brrp_cli.tracking.moved import moved_object

STEP = 0.03  # radians, a frame
TRACK = TrackConfig()
NOISE = {"noise": 0.001, "known": True}


def round_by(steps: int) -> dict[str, float]:
    return {"yaw": YAW + STEP * steps, "seed": steps} | NOISE


def test_results_go_along_with_a_camera_that_moves_a_little(inferred):
    first_frame, frame = scene(START, **NOISE), scene(START, **round_by(2))
    with Reconstructor(method="sphere", track=True) as session:
        first, now = session(first_frame), session(frame)
        assert inferred == [[1, 2, 3]]
        T = inverse(frame.T_world_cam) @ first_frame.T_world_cam
        for was, item in zip(first.objects, now.objects, strict=True):
            assert item.object_id == was.object_id and item.seconds == {}
            for name in ("center", "observed"):
                there = transform_points(T, getattr(was, name))
                np.testing.assert_allclose(getattr(item, name), there, atol=1e-6)
            there = transform_points(T, was.surface.vertices)
            np.testing.assert_allclose(item.surface.vertices, there)
            p = item.posterior.probability(there)
            np.testing.assert_allclose(p, was.posterior.probability(was.surface.vertices), 1e-4)
        # From another side they are done again, once.
        session(scene(START, **round_by(5)))
        session(scene(START, **round_by(6)))
    assert inferred == [[1, 2, 3]] * 2


def test_poses_go_along_and_so_do_those_that_are_alike(inferred):
    with Reconstructor(method="sphere", track=True) as session:
        item = session(scene(START, **NOISE)).objects[0]
    pose, other, T = (
        similarity(rotation=turn_about_z(angle)[:3, :3], translation=np.array([0.1, angle, 0.5]))
        for angle in (0.2, 0.7, -0.3)
    )
    told = Retrieved("ball", 1.0, pose, T_cam_mesh=pose, size_factor=1.0, alike=(other,))
    (found,) = moved_object(replace(item, retrieved=[told]), T).retrieved
    np.testing.assert_allclose(found.T_cam_object, T @ pose)
    np.testing.assert_allclose(found.T_cam_mesh, T @ pose)
    np.testing.assert_allclose(found.alike, [T @ other])


def test_they_are_moved_from_where_they_were_inferred(inferred):
    """Not from frame to frame, or errors would add up."""
    with Reconstructor(method="sphere", track=True) as session:
        first = session(scene(START, **NOISE))
        for _ in range(3):
            for steps in (1, 2, 1, 0):
                last = session(scene(START, **(round_by(steps) | {"seed": 0})))
    assert inferred == [[1, 2, 3]]
    for was, item in zip(first.objects, last.objects, strict=True):
        np.testing.assert_array_equal(item.surface.vertices, was.surface.vertices)


@pytest.mark.parametrize(
    "changed",
    [
        {"yaw": YAW + 0.15},
        {"places": START | {GREEN: (0.104, 0.008)}},
        {"places": START | {GREEN: (0.12, 0.13)}},
    ],
    ids=["another side", "slid by 9 mm", "moved"],
)
def test_what_is_seen_otherwise_is_inferred(changed, inferred):
    places = changed.pop("places", START)
    with Reconstructor(method="sphere", track=True) as session:
        session(scene(START, **NOISE))
        session(scene(places, **(round_by(1) | changed)))
    assert len(inferred) == 2 and set(inferred[1]) <= {1, 2, 3}
    assert (len(inferred[1]) == 3) == (places is START)


def test_without_odometry_without_glide_and_where_nothing_can_be_moved_all_is_inferred(
    inferred, monkeypatch
):
    def asked(track, **kwargs):
        inferred.clear()
        with Reconstructor(method="sphere", track=track) as session:
            session(scene(START, **(NOISE | kwargs)))
            session(scene(START, **(round_by(2) | kwargs)))
        return len(inferred)

    assert asked(TRACK) == 1
    assert asked(TRACK, known=False) == 1
    assert asked(replace(TRACK, odometry=None), known=False) == 2
    assert asked(replace(TRACK, glide=None)) == 2
    monkeypatch.delattr(Sphere, "moved")
    assert asked(TRACK) == 2


def test_masks_go_along(made):
    with Reconstructor(method="sphere", track=True) as session:
        first = session(bare(START, **NOISE))
        for steps in (1, 2, 3):
            now = session(bare(START, **round_by(steps)))
            assert now.seconds["masks"] == 0 and now.segmentation == first.segmentation
            true = scene(START, **round_by(steps))
            assert by_colour(now) == by_colour(first)
            for colour, object_id in by_colour_of(true).items():
                mask = now.frame.segmap == by_colour(now)[colour]
                theirs = true.segmap == object_id
                assert (mask & theirs).sum() > 0.93 * (mask | theirs).sum()
        assert len(made) == 1
        session(bare(START, **round_by(6)))
    assert len(made) == 2, "from another side"


@pytest.mark.parametrize(
    "now",
    [
        START | {(220, 210, 60): (0.0, 0.0)},
        {RED: A, BLUE: START[BLUE]},
        {RED: A, (220, 210, 60): START[GREEN], BLUE: START[BLUE]},
        START | {GREEN: (0.12, 0.13)},
        START | {GREEN: (0.108, 0.013)},
    ],
    ids=["has come", "has gone", "another in its place", "has moved", "has slid"],
)
def test_masks_are_made_where_something_else_is_seen(now, made):
    with Reconstructor(method="sphere", track=True) as session:
        ids = by_colour(session(bare(START, **NOISE)))
        found = by_colour(session(bare(now, **round_by(1))))
    assert len(made) == 2 and set(found) == set(now)
    assert all(found[colour] == ids[colour] for colour in set(now) & set(START))


def test_what_was_hidden_is_no_object_if_it_is_the_table(made):
    """Behind the boxes a strip of table comes to light; without a plane it could be anything."""
    then, now = scene(START, known=True), scene(START, yaw=YAW + 0.2, known=True)
    table = Plane(np.array([0.0, 0.0, 1.0]), 0.0).moved(inverse(then.T_world_cam))
    beneath = Plane(table.normal, table.offset + 0.05)
    far = replace(TRACK, glide=replace(TRACK.glide, side=0.3, near=1.3))
    assert glided(then, now, table, far) is not None
    assert glided(then, now, beneath, far) is None
    assert glided(then, now, None, far) is None


def test_much_that_the_earlier_image_did_not_show_asks_for_masks():
    then, now = scene(START, **NOISE), scene(START, **round_by(1))
    assert glided(then, now, None, TRACK) is not None
    none = replace(TRACK, glide=replace(TRACK.glide, outside=0.001))
    assert glided(then, now, None, none) is None


def test_pixels_without_depth_keep_their_masks():
    then, now = scene(START, **NOISE), scene(START, **round_by(2))
    blind = []
    for frame in (then, now):
        points = frame.points.copy()
        box = frame.segmap == by_colour_of(frame)[GREEN]
        rows, columns = np.nonzero(box)
        hole = (slice(int(np.quantile(rows, 0.3)), int(np.quantile(rows, 0.7))),) + (
            slice(int(np.quantile(columns, 0.3)), int(np.quantile(columns, 0.7))),
        )
        points[hole] = np.nan
        blind.append(replace(frame, points=points))
    found = glided(*blind, None, TRACK)
    assert found is not None
    mask, true = found.segmap == by_colour_of(then)[GREEN], now.segmap == by_colour_of(now)[GREEN]
    assert (mask & true & ~found.valid).sum() > 0.9 * (true & ~found.valid).sum() > 0


def by_colour_of(frame) -> dict[tuple[int, ...], int]:
    return {
        tuple(int(c) for c in np.median(frame.rgb[frame.segmap == i], axis=0)): i
        for i in frame.object_ids
    }
