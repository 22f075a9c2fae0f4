"""How a camera that does not tell it has moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from test_tracking import BLUE, GREEN, RED, START, YAW, scene
from test_tracking import inferred as inferred

from brrp_cli import Reconstructor
from brrp_cli.config.tracking import TrackConfig
from brrp_cli.geometry import transform_points
from brrp_cli.tracking.motion import background_stands, camera_motion, camera_stands, edge_motion
from brrp_cli.tracking.odometry import Odometry, replace_pose

TRACK = TrackConfig()
STEP = 0.03  # radians
PLACES = START | {(230, 200, 60): (0.15, 0.2)}


def posed(frames, config=TRACK):
    """The frames with their places in the stream, each with its masks once it was the newest."""
    odometry, last, found = Odometry(config), None, []
    for frame in frames:
        bare = frame.without_masks()
        last = replace_pose(frame, odometry(bare, last).stream_pose)
        found.append(last)
    return found


def shown(steps, places=PLACES, noise=0.001):
    """(frames that tell their pose, the same that do not) from `steps` x STEP round the table."""
    known = [
        scene(places, yaw=YAW + STEP * step, noise=noise, seed=seed, known=True)
        for seed, step in enumerate(steps)
    ]
    return known, [replace(frame, T_world_cam=None) for frame in known]


def off(true_then, true_now, T):
    """Metres between where objects are and where T (4, 4) puts what was seen of them."""
    points = np.concatenate([true_then.object_points(i) for i in true_then.object_ids])
    T_now_then = camera_motion(true_then, true_now, TRACK)
    apart = transform_points(T, points) - transform_points(T_now_then, points)
    return float(np.linalg.norm(apart, axis=1).mean())


def test_it_follows_a_camera_round_a_table():
    known, unknown = shown(range(6))
    frames = posed(unknown)
    assert {frame.stream_pose.stream for frame in frames} == {1}
    for last, frame, true_last, true in zip(frames, frames[1:], known, known[1:], strict=False):
        T = camera_motion(last, frame, TRACK)
        assert off(true_last, true, T) < 0.0015 < 0.003 < off(true_last, true, np.eye(4))
    # Over 10 cm of way.
    assert off(known[0], known[-1], camera_motion(frames[0], frames[-1], TRACK)) < 0.004


def test_errors_do_not_add_up_before_a_camera_that_sways():
    steps = [0, 1, 2, 1] * 2 + [0]
    known, unknown = shown(steps)
    frames = posed(unknown)
    first, back = frames[0], frames[-1]
    assert off(known[0], known[-1], camera_motion(first, back, TRACK)) < 0.001


def test_the_same_frames_give_the_same_bytes():
    _, unknown = shown(range(3))
    one, other = posed(unknown), posed(unknown)
    for a, b in zip(one, other, strict=True):
        assert a.stream_pose.T_stream_cam.tobytes() == b.stream_pose.T_stream_cam.tobytes()


def test_before_a_camera_that_stands_nothing_has_moved_but_what_was():
    frames = posed(
        scene(places, noise=0.001, seed=seed)
        for seed, places in enumerate([PLACES, PLACES, PLACES | {GREEN: (0.12, 0.13)}, PLACES])
    )
    for frame in frames[1:]:
        T = camera_motion(frames[0], frame, TRACK)
        assert camera_stands(T, TRACK)
        np.testing.assert_array_equal(T, np.eye(4))


def test_after_a_jump_another_stream_begins():
    frames = posed(scene(PLACES, yaw=yaw) for yaw in (YAW, YAW + 1.5, YAW + 1.5))
    streams = [frame.stream_pose.stream for frame in frames]
    assert streams[0] != streams[1] == streams[2]
    assert camera_motion(frames[0], frames[1], TRACK) is None
    assert camera_stands(camera_motion(frames[1], frames[2], TRACK), TRACK)


def test_another_image_size_begins_another_stream():
    whole, again = scene(PLACES), scene(PLACES)
    half = replace(
        again,
        rgb=again.rgb[:, :-20],
        points=again.points[:, :-20],
        segmap=again.segmap[:, :-20],
    )
    frames = posed([whole, half])
    assert frames[0].stream_pose.stream != frames[1].stream_pose.stream


def test_frames_that_tell_their_pose_keep_it_and_nobody_is_asked_without_a_configuration():
    known, unknown = shown(range(2))
    assert [Odometry(TRACK)(frame, None) for frame in known] == list(known)
    none = replace(TRACK, odometry=None)
    assert [frame.stream_pose for frame in posed(unknown, none)] == [None, None]


def test_edges_lie_where_they_did_or_do_not():
    """In sharp and plain images, too, where an edge that goes leaves one of its sides as it was."""
    rng = np.random.default_rng(0)
    frame = scene(PLACES)
    noisy = np.clip(frame.rgb + rng.normal(0, 4, frame.rgb.shape), 0, 255).astype(np.uint8)
    assert edge_motion(frame, replace(frame, rgb=noisy), TRACK) < 0.15
    for way, axis in ((1, 1), (-1, 1), (1, 0)):
        moved = replace(frame, rgb=np.roll(frame.rgb, way, axis))
        assert edge_motion(frame, moved, TRACK) > 0.4
    plain = replace(frame, rgb=np.full_like(frame.rgb, 90))
    assert edge_motion(plain, frame, TRACK) == 0
    grey = [scene(PLACES), scene(PLACES, yaw=YAW + STEP)]
    assert not background_stands(*grey, TRACK), "a table looks the same from all sides"


def test_results_and_ids_go_along_without_a_pose(inferred):
    _, frames = shown(range(6))
    with Reconstructor(method="sphere", track=True) as session:
        results = [session(frame) for frame in frames]
    colours = {RED, GREEN, BLUE}
    ids = [
        {tuple(np.median(r.frame.rgb[r.frame.segmap == i], axis=0)): i for i in r.frame.object_ids}
        for r in results
    ]
    assert all(each == ids[0] for each in ids) and colours <= set(ids[0])
    done = [i for each in inferred for i in each]
    assert sorted(done) == sorted([*ids[0].values()] * 2), "0.15 radians: two sides"
    assert all(r.frame.T_world_cam is None for r in results)
    assert all(r.seconds["tracking"] > 0 for r in results)
