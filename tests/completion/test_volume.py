"""What a frame shows around an object, as a volume that stands on the table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from table_scene import T_CAM_WORLD, TABLE, ball, box, in_camera, photograph, placed

from brrp_cli.completion.point_features import point_features
from brrp_cli.completion.visible_part import visible_part
from brrp_cli.completion.volume import CHANNELS, volume_of
from brrp_cli.config import CompletionConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, transform_points

CONFIG = CompletionConfig()
NEAR, FAR, OWN, OTHER, UNKNOWN, WITHIN, SEEN, HEIGHT = range(CHANNELS)


def part_of(frame, plane=TABLE):
    return visible_part(frame.object_points(5), frame, 5, plane, CONFIG)


def at(volume, points):
    """Values (CHANNELS, n) in the voxels of points (n, 3), camera frame, 1 for the most."""
    side = volume.values.shape[1]
    voxel = np.floor((volume.places(points) + 1) / 2 * side).astype(int)
    return volume.values[:, voxel[:, 0], voxel[:, 1], voxel[:, 2]] / 127


@pytest.fixture(scope="module")
def volume():
    return volume_of(
        part_of(photograph({5: in_camera(ball(), placed(0.0, 0.0, 0.0))})), CONFIG.volume
    )


def test_it_holds_the_object_and_stands_on_the_table(volume):
    corners = transform_points(T_CAM_WORLD, ball().vertices)
    # Of what is hidden behind it a little may stick out: features there are those of the border.
    assert (np.abs(volume.places(corners)).max(axis=0) < [1, 1.15, 1]).all()
    middle, foot = volume.places(
        transform_points(T_CAM_WORLD, np.array([[0, 0, 0.05], [0, 0, 0.0]]))
    )
    assert abs(middle[0]) < 0.1, "in the middle, left and right"
    assert -1 < foot[2] < -0.8, "what there is to spare is above"


def test_its_channels_say_what_is_known_of_a_place(volume):
    sight = np.array([0.0, 0.0, 0.05]) - np.linalg.inv(T_CAM_WORLD)[:3, 3]
    toward = sight / np.linalg.norm(sight)
    middle = np.array([0.0, 0.0, 0.05])
    front, inside, before = middle - 0.049 * toward, middle, middle - 0.062 * toward
    found = at(volume, transform_points(T_CAM_WORLD, np.array([front, inside, before])))
    assert abs(found[NEAR, 0]) < 0.5 and found[NEAR, 1] == 1 and found[NEAR, 2] < -0.5
    assert (found[OWN] == 1).all() and (found[[OTHER, UNKNOWN]] == 0).all()
    assert found[FAR, 0] < found[FAR, 1]
    assert found[SEEN, 0] > 0.4 and (found[SEEN, 1:] == 0).all()
    assert 0.3 < found[HEIGHT, 1] < 0.7


def mirrored(frame):
    """The frame as in a mirror, left and right."""
    depth = np.where(frame.valid, frame.points[..., 2], 0.0)[:, ::-1]
    K = frame.K.copy()
    K[0, 2] = frame.shape[1] - 1 - K[0, 2]
    return Frame(frame.rgb[:, ::-1], backproject(depth, K), frame.segmap[:, ::-1].copy(), K)


def test_a_mirrored_frame_has_the_mirrored_volume_and_the_same_lengths():
    """On this the training relies that sees every object from both sides."""
    frame = photograph({5: in_camera(box(), placed(0.03, -0.02, 0.4))})
    one, two = (
        part_of(frame),
        part_of(mirrored(frame), replace(TABLE, normal=TABLE.normal * [-1, 1, 1])),
    )
    volume, other = (volume_of(part, CONFIG.volume) for part in (one, two))
    assert other.edge == pytest.approx(volume.edge, rel=0.02)
    near = np.abs(volume.values[:, ::-1].astype(int) - other.values) <= 12
    assert near.mean() > 0.97
    points = one.seen + np.random.default_rng(0).normal(0, 0.02, one.seen.shape)
    place, image = volume.places(points), other.places(points * [-1, 1, 1])
    np.testing.assert_allclose(image, place * [-1, 1, 1], atol=0.05)
    lengths, same = point_features(points, one), point_features(points * [-1, 1, 1], two)
    assert (np.abs(lengths - same) < 0.1 + 0.1 * np.abs(lengths)).mean() > 0.93


def test_what_stands_before_it_makes_room_for_what_is_hidden():
    alone = photograph({5: in_camera(ball(), placed(0.0, 0.0, 0.0))})
    x, y = (
        0.1 * np.linalg.inv(T_CAM_WORLD)[:2, 3] / np.linalg.norm(np.linalg.inv(T_CAM_WORLD)[:2, 3])
    )
    hidden = photograph(
        {
            5: in_camera(ball(), placed(0.0, 0.0, 0.0)),
            6: in_camera(box(), placed(x, y, 0.3)),
        }
    )
    volume = volume_of(part_of(hidden), CONFIG.volume)
    assert (volume.values[OTHER] == 127).any()
    part = part_of(hidden)
    bare = volume_of(part, replace(CONFIG.volume, hidden=0.0))
    assert volume.edge > 1.05 * bare.edge
    assert volume_of(part_of(alone), CONFIG.volume).edge == pytest.approx(
        volume_of(part_of(alone), replace(CONFIG.volume, hidden=0.0)).edge
    )


def test_without_a_plane_there_is_a_volume_too():
    frame = photograph({5: in_camera(ball(), placed(0.0, 0.0, 0.0))})
    found = volume_of(part_of(frame, None), CONFIG.volume)
    assert np.isfinite(found.edge) and (found.values[OWN] == 127).any()
