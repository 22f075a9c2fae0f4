"""Scenes in a bin, on a platform, in a shelf, before a wall, under an arm, and on one another."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

pytest.importorskip("pybullet")

from made_scenes import bytes_of, generate, write_box, write_two
from tabletop.bin import draw_bin
from tabletop.camera import draw_camera
from tabletop.models import find_meshes, load_model
from tabletop.platform import draw_platform
from tabletop.robot import CLEARANCE, SIDE, draw_robot
from tabletop.settle import rotation
from tabletop.shelf import BESIDE, draw_shelf
from tabletop.stack import stack

from brrp_cli.geometry import transform_points
from brrp_cli.ground_truth.scenes import find_scenes, true_mesh
from brrp_cli.raycast import raycasting_scene
from brrp_cli.seeds import child_rng


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return write_two(tmp_path_factory.mktemp("data"))


def generate_twice(data, name, *options):
    for folder in (name, f"{name}_again"):
        result = generate(data, data / folder, *options)
        assert result.exit_code == 0, result.output
    assert bytes_of(data / name) == bytes_of(data / f"{name}_again")


def test_objects_lie_in_a_bin_that_is_background(data):
    options = ("--scenes", 2, "--views", 1, "--elevation", 60, 80, "--bin")
    generate_twice(data, "binned", *options)
    for number, scene in enumerate(find_scenes(data / "binned")):
        box = draw_bin(child_rng(0, "scene", number, "bin"))
        floor, walls = box.panels()[0], box.panels()[1:]
        lowest = [true_mesh(o, data).bounds[0, 2] for o in scene.objects]
        assert min(lowest) == pytest.approx(box.thickness, abs=0.002)
        turned = rotation(floor.orientation)
        for each in scene.objects:
            inside = np.abs(true_mesh(each, data).vertices @ turned)[:, :2]
            assert (inside.max(axis=0) < floor.half[:2] + box.height * np.tan(box.lean)).all()
        frame = scene.view(0)
        points = transform_points(frame.T_world_cam, frame.points[frame.valid].astype(np.float64))
        on_wall = np.zeros(len(points), bool)
        for wall in walls:
            local = np.abs((points - wall.position) @ rotation(wall.orientation))
            on_wall |= (local < wall.half + 1e-3).all(axis=1)
        assert on_wall.sum() > 300
        assert (frame.segmap[frame.valid][on_wall & (points[:, 2] > 0.02)] == 0).mean() > 0.97


def test_objects_lie_on_a_platform_that_is_background(data):
    generate_twice(data, "on_platform", "--scenes", 2, "--views", 1, "--platform")
    for number, scene in enumerate(find_scenes(data / "on_platform")):
        platform = draw_platform(child_rng(0, "scene", number, "platform"))
        (panel,) = platform.panels()
        assert panel.position[2] - panel.half[2] == pytest.approx(0)
        lowest = [true_mesh(o, data).bounds[0, 2] for o in scene.objects]
        assert max(lowest) == pytest.approx(platform.thickness, abs=0.002)
        frame = scene.view(0)
        points = transform_points(frame.T_world_cam, frame.points[frame.valid].astype(np.float64))
        local = np.abs((points - panel.position) @ rotation(panel.orientation))
        on_it = (local < panel.half + 1e-3).all(axis=1) & (points[:, 2] > panel.half[2])
        assert on_it.sum() > 300
        assert (frame.segmap[frame.valid][on_it] == 0).mean() > 0.97


@pytest.mark.parametrize("seed", range(3))
def test_a_bins_walls_stand_around_its_floor(seed):
    box = draw_bin(np.random.default_rng(seed))
    floor, *walls = box.panels()
    assert floor.position[2] - floor.half[2] == pytest.approx(0)
    for wall in walls:
        up = rotation(wall.orientation)[:, 2]
        assert np.arccos(up[2]) == pytest.approx(box.lean, abs=1e-6)
        assert up[:2] @ wall.position[:2] >= -1e-9, "outwards"
        foot = wall.position - up * wall.half[2]
        assert foot[2] == pytest.approx(0, abs=1e-9)
    spans = {round(float(np.linalg.norm(wall.position[:2])), 6) for wall in walls}
    assert len(spans) == 2


def test_objects_stand_in_a_shelf_that_a_camera_sees_into(data):
    options = ("--scenes", 2, "--views", 2, "--elevation", 10, 25, "--shelf")
    generate_twice(data, "shelved", *options)
    for number, scene in enumerate(find_scenes(data / "shelved")):
        shelf = draw_shelf(child_rng(0, "scene", number, "shelf"))
        back = np.array([np.cos(shelf.turn), np.sin(shelf.turn), 0.0])
        across = np.array([-back[1], back[0], 0.0])
        for each in scene.objects:
            vertices = true_mesh(each, data).vertices
            assert vertices[:, 2].min() == pytest.approx(0.0, abs=0.002)
            assert (vertices @ back).min() > -shelf.depth / 2 - 0.002
            assert np.abs(vertices @ across).max() < shelf.width / 2 + 0.002
        for view in (0, 1):
            frame = scene.view(view)
            aside = np.arctan2(*(frame.T_world_cam[:3, 3] @ np.stack([across, back]).T))
            assert abs(np.rad2deg(aside)) < 2 * BESIDE, "it stands before the opening"
            assert frame.object_ids, "objects show"
            points = transform_points(frame.T_world_cam, frame.points[frame.valid].astype(float))
            behind = points[:, :2] @ back[:2] < -shelf.depth / 2 + 1e-3
            assert behind.mean() > 0.05 and (frame.segmap[frame.valid][behind] == 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_shelfs_boards_close_it_but_for_its_front(seed):
    shelf = draw_shelf(np.random.default_rng(seed)).over(np.array([[0.0, 0.0, 0.3]]))
    assert shelf.height > 0.3
    boxes = [trimesh.creation.box(2 * panel.half, _pose(panel)) for panel in shelf.panels()]
    inside = np.array([0.0, 0.0, shelf.height / 2])
    turn = trimesh.transformations.rotation_matrix(shelf.turn, [0, 0, 1])[:3, :3]
    ways = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]) @ turn.T
    rays = np.concatenate([np.tile(inside, (6, 1)), ways], axis=1).astype(np.float32)
    hit = np.isfinite(raycasting_scene(boxes).cast_rays(rays)["t_hit"].numpy())
    assert hit.tolist() == [False, True, True, True, True, True]
    assert shelf.ground.position[2] < -0.3


def _pose(panel):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(panel.orientation), panel.position
    return T


def test_a_wall_stands_behind_what_the_camera_sees_and_moves_nothing(data):
    options = ("--scenes", 2, "--views", 1, "--elevation", 8, 20)
    for folder, more in (("bare", ()), ("walled", ("--wall",)), ("walled_again", ("--wall",))):
        result = generate(data, data / folder, *options, *more)
        assert result.exit_code == 0, result.output
    assert bytes_of(data / "walled") == bytes_of(data / "walled_again")
    scenes = zip(find_scenes(data / "bare"), find_scenes(data / "walled"), strict=True)
    for bare, walled in scenes:
        poses = [[each.T_world_object for each in scene.objects] for scene in (bare, walled)]
        assert np.array_equal(*poses)
        before, frame = bare.view(0), walled.view(0)
        assert (before.segmap == frame.segmap).all(), "it hides no object"
        new = frame.valid & ~(np.abs(frame.depth - before.depth) < 1e-3)
        assert new.mean() > 0.2 and (frame.segmap[new] == 0).all()
        points = transform_points(frame.T_world_cam, frame.points[new].astype(np.float64))
        spread = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        assert spread[1][2] < 1e-3 * spread[1][1], "one plane"
        assert abs(spread[2][2] @ [0, 0, 1]) < 1e-3, "that stands upright"


def test_an_arm_reaches_in_over_the_objects_and_moves_nothing(data):
    for folder, more in (("alone", ()), ("manned", ("--robot",)), ("manned_again", ("--robot",))):
        result = generate(data, data / folder, "--scenes", 2, "--views", 1, *more)
        assert result.exit_code == 0, result.output
    assert bytes_of(data / "manned") == bytes_of(data / "manned_again")
    scenes = zip(find_scenes(data / "alone"), find_scenes(data / "manned"), strict=True)
    for alone, manned in scenes:
        poses = [[each.T_world_object for each in scene.objects] for scene in (alone, manned)]
        assert np.array_equal(*poses)
        before, frame = alone.view(0), manned.view(0)
        new = frame.valid & ~(np.abs(frame.depth - before.depth) < 1e-3)
        assert new.mean() > 0.02 and (frame.segmap[new] == 0).all(), "it is background"
        assert not (frame.depth[new] > before.depth[new] + 1e-3).any(), "and hides what is behind"
        assert (before.segmap == frame.segmap)[~new].all()
        points = transform_points(frame.T_world_cam, frame.points[new].astype(np.float64))
        highest = max(true_mesh(each, data).bounds[1, 2] for each in manned.objects)
        near = np.linalg.norm(points[:, :2], axis=1) < 0.2
        assert points[near, 2].min() > 0.01 and points[:, 2].max() > highest


@pytest.mark.parametrize("seed", range(3))
def test_an_arms_hand_is_over_what_is_beneath_it(seed):
    camera = draw_camera(np.zeros(3), (64, 48), np.random.default_rng(seed))
    side = np.linspace(-0.3, 0.3, 13)
    things = np.stack([*(each.ravel() for each in np.meshgrid(side, side)), np.full(169, 0.1)], 1)
    robot = draw_robot(things, camera, np.random.default_rng(seed))
    corners = [trimesh.creation.box(2 * p.half, _pose(p)).vertices for p in robot.panels()]
    palm, *fingers = (np.asarray(each) for each in corners[:3])
    gap = min(each[:, 2].min() for each in fingers) - 0.1
    assert CLEARANCE[0] - 1e-9 < gap < CLEARANCE[1], "fingers end over the highest thing"
    assert palm[:, 2].mean() > max(each[:, 2].mean() for each in fingers)
    shoulder = np.concatenate(corners[3:])
    farthest = shoulder[np.argmax(np.linalg.norm(shoulder[:, :2], axis=1)), :2]
    assert np.linalg.norm(farthest) > 0.4
    towards = np.array([camera.view[2, 0], camera.view[2, 1]])
    cosine = farthest @ towards / np.linalg.norm(farthest) / np.linalg.norm(towards)
    assert cosine < np.cos(np.deg2rad(SIDE[0] - 25)), "it does not come from the camera's side"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--bin", "--stack"), "exclude one another"),
        (("--bin", "--shelf"), "exclude one another"),
        (("--platform", "--bin"), "exclude one another"),
        (("--wall", "--platform"), "take --views 1"),
        (("--wall", "--shelf"), "take --views 1"),
        (("--wall", "--bin"), "take --views 1"),
        (("--wall", "--views", 2), "take --views 1"),
        (("--robot", "--views", 2), "take --views 1"),
        (("--robot", "--bin"), "take --views 1"),
        (("--robot", "--wall"), "not both"),
    ],
)
def test_what_does_not_go_together_is_told(data, options, told):
    result = generate(data, data / "both", *options)
    assert result.exit_code == 2 and told in result.output


def test_stacked_objects_rest_on_and_in_one_another(data):
    write_box(data / "stacks", "003_brick", (0.2, 0.2, 0.06), (0, 0, 0), (0, 255, 0))
    outside = trimesh.creation.box((0.24, 0.24, 0.1))
    tub = outside.difference(trimesh.creation.box((0.2, 0.2, 0.1)).apply_translation((0, 0, 0.02)))
    tub.export(data / "tub.obj")
    (brick,) = find_meshes(data / "stacks")
    small = load_model(find_meshes(data / "meshes")[0])
    models = [load_model(brick), small, load_model(data / "tub.obj"), small]
    poses = stack(models, np.random.default_rng(0))
    assert all(pose is not None for pose in poses)
    lowest = [
        float(pose.apply(model.hull + model.center)[:, 2].min())
        for pose, model in zip(poses, models, strict=True)
    ]
    assert np.allclose(lowest, [0, 0.06, 0, 0.02], atol=0.002)
    again = stack(models, np.random.default_rng(0))
    assert all(
        np.array_equal(a.position, b.position) and np.array_equal(a.orientation, b.orientation)
        for a, b in zip(poses, again, strict=True)
    )


def test_the_option_makes_stacked_scenes(data):
    assert generate(data, data / "on", "--scenes", 1, "--views", 1, "--stack").exit_code == 0
    entries = json.loads((data / "on" / "00000000" / "objects.json").read_text())
    assert max(entry["position"][2] for entry in entries) > 0
