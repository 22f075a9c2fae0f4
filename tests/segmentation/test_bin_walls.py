"""The walls of bins as solids, and the outlines that they stand on."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
import trimesh
from bin_scene import FLOOR, HEIGHT, LENGTH, T_WORLD_CAM, WALL, WIDTH, YAW, seen, standing

from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.demo.layout import camera_pose
from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.geometry import similarity, transform_points, turn_about_z
from brrp_cli.raycast import raycasting_scene
from brrp_cli.segmentation.furniture import furniture, segmentation_of
from brrp_cli.segmentation.outlines import corners_of, normals_of, plain, shifted
from brrp_cli.segmentation.seen_table import see_table
from brrp_cli.shapes import solids

CONFIG = SegmentConfig()
T_BIN_CAM = np.linalg.inv(
    np.linalg.inv(T_WORLD_CAM) @ similarity(1.0, turn_about_z(YAW), np.zeros(3))
)
THING = standing((0.08, 0.06, 0.07), 0.05, 0.02)
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])


def bin_walls(frame, config=CONFIG):
    """Of each bin, camera frame."""
    try:
        plane = see_table(frame.points, frame.K, 0, None, config).table.plane
    except FrameError:
        plane = None
    return furniture(frame, plane, 0, config).bins


def walls(frame, T=T_BIN_CAM):
    """Of the one bin, (n, 8, 3), in the bin's own frame."""
    (found,) = bin_walls(frame)
    return np.stack([transform_points(T, wall) for wall in found])


def tapered(top: float) -> trimesh.Trimesh:
    """A bin whose rim is `top` metres wider on each side than its floor."""

    def block(grown: float, low: float) -> trimesh.Trimesh:
        corners = [
            [s * (LENGTH / 2 + grown + out), t * (WIDTH / 2 + grown + out), z]
            for s in (-1, 1) for t in (-1, 1) for out, z in ((0.0, low), (top, HEIGHT))
        ]  # fmt: skip
        return trimesh.convex.convex_hull(np.array(corners))

    return solids.difference(block(WALL, 0.0), block(0.0, FLOOR))


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_bin_has_four_walls_where_its_own_are(noise):
    found = walls(seen(THING, noise=noise))
    assert len(found) == 4
    across = np.array([LENGTH + WALL, WIDTH + WALL]) / 2
    middles = np.abs(found.mean(axis=1))
    for axis, side in enumerate(across):
        facing = middles[:, axis] > side / 2
        assert facing.sum() == 2
        np.testing.assert_allclose(middles[facing, axis], side, atol=0.006)
    assert found[..., 2].max() == pytest.approx(HEIGHT, abs=0.006)
    assert found[..., 2].min() == pytest.approx(0.0, abs=0.004)


def test_walls_lean_as_the_bin_does():
    found = walls(seen(THING, bin=tapered(0.012)))
    assert len(found) == 4
    rim, foot = found[:, :4].mean(axis=1), found[:, 4:].mean(axis=1)
    out = np.linalg.norm(rim[:, :2], axis=1) - np.linalg.norm(foot[:, :2], axis=1)
    assert (out > 0.004).all() and (out < 0.02).all()


def test_what_is_hidden_of_a_wall_is_there():
    """The inner face of the near wall cannot be seen; what is solid reaches through it."""
    frame = seen(THING)
    near = T_BIN_CAM[:2, 3] / np.abs(T_BIN_CAM[:2, 3]).max()
    side = np.argmax(np.abs(T_BIN_CAM[:2, 3]))
    middle = np.array([0.0, 0.0, HEIGHT / 2])
    middle[side] = np.sign(near[side]) * (LENGTH, WIDTH)[side] / 2
    scene = raycasting_scene([trimesh.convex.convex_hull(wall) for wall in walls(frame)])
    distance = scene.compute_distance(middle[None].astype(np.float32)).numpy()
    assert distance.max() < 0.006


def test_where_the_border_cuts_a_bin_is_no_wall():
    aside = camera_pose(np.array([0.14, 0.12, 0.03]), 0.6, np.deg2rad(60.0), 0.9)
    frame = seen(THING, T_world_cam=aside)
    T = np.linalg.inv(np.linalg.inv(aside) @ similarity(1.0, turn_about_z(YAW), np.zeros(3)))
    found = walls(frame, T)
    outer = np.abs(found.mean(axis=1)[:, :2]) / (np.array([LENGTH, WIDTH]) / 2)
    np.testing.assert_allclose(outer.max(axis=1), 1.0, atol=0.06)


def test_a_bin_with_a_mask_is_an_object():
    frame = seen(THING)
    found = bin_walls(frame)
    whole = replace(frame, segmap=np.where(_of_the_bin(frame), 5, frame.segmap))
    assert len(found) == 1 and bin_walls(whole) == []


def _of_the_bin(frame):
    """(H, W) the pixels that show it."""
    points = transform_points(T_BIN_CAM, frame.points)
    beyond = np.abs(points[..., :2]) - np.array([LENGTH, WIDTH]) / 2
    return (beyond.max(axis=-1) > -0.002) & (points[..., 2] > 0.004) & (frame.segmap == 0)


def test_without_a_table_there_are_none():
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.4, 2.0, (120, 160))
    K = np.array([[150.0, 0, 80], [0, 150.0, 60], [0, 0, 1]])
    frame = make_frame(depth=depth, K=K)
    with pytest.raises(FrameError):
        see_table(frame.points, frame.K, 0, None, CONFIG)
    assert bin_walls(frame) == []


def test_results_tell_what_a_bin_was():
    assert segmentation_of(None) == CONFIG
    # Of a result in memory, whose record was never written, too.
    own = replace(CONFIG, min_area=0.5)
    assert segmentation_of(asdict(own)) == own
    assert segmentation_of({"bins": {"area": 10.0}}).bins.area == 10.0
    none = segmentation_of({"bins": {"area": 10.0, "rectangle": 10.0}})
    assert bin_walls(seen(THING), none) == []


def test_corners_of_half_planes_come_in_order():
    hull = np.array([[0, -1, 0], [1, 0, -2], [0, 1, -1], [-1, 0, 0.0]])
    found = corners_of(hull)
    first = np.argmin(np.linalg.norm(found, axis=1))
    np.testing.assert_allclose(np.roll(found, -first, axis=0), SQUARE, atol=1e-9)


def test_sides_move_along_their_normals():
    np.testing.assert_allclose(normals_of(SQUARE), [[0, -1], [1, 0], [0, 1], [-1, 0]], atol=1e-12)
    grown = shifted(SQUARE, 0.5)
    np.testing.assert_allclose(grown, [[-0.5, -0.5], [2.5, -0.5], [2.5, 1.5], [-0.5, 1.5]])
    np.testing.assert_allclose(shifted(grown, -0.5), SQUARE, atol=1e-12)


def test_an_outline_becomes_plain():
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    few = plain(circle, 0.93, 0.05)
    assert 6 <= len(few) < 30
    cut = np.array([[0.05, 0], [1.95, 0], [2, 0.05], [2, 1], [0, 1], [0, 0.05]])
    box = plain(cut, 0.93, 0.01)
    assert len(box) == 4
    assert sorted(map(tuple, np.round(box, 6))) == sorted(map(tuple, SQUARE))
    assert (normals_of(box) * (box.mean(axis=0) - box)).sum(axis=1).max() < -0.4  # counterclockwise
