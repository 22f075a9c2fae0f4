import json

import numpy as np
import pytest
import trimesh
from for_people import assert_for_people
from PIL import Image

from brrp_cli.errors import FrameError, SceneError
from brrp_cli.frames.npz import load_frame
from brrp_cli.geometry import transform_points
from brrp_cli.ground_truth.scenes import find_scenes, true_mesh, true_mesh_in_camera

H, W, NEAR, FAR, HEIGHT = 24, 32, 0.1, 5.0, 1.0
# Half a turn around x: a camera that looks straight down from HEIGHT above the origin.
T_WORLD_CAM = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, HEIGHT], [0, 0, 0, 1]])
QUARTER_TURN_Z = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]


def entry(object_id=3, **changes):
    return {
        "id": object_id,
        "mesh_path": "ycb/011_banana/google_16k/textured.obj",
        "position": [0.1, 0.2, 0.3],
        "orientation": QUARTER_TURN_Z,
        "scale": 2.0,
    } | changes


def mask():
    segmap = np.full((H, W), -1, dtype=np.int32)
    segmap[4:] = 7  # the table's number in the simulator
    segmap[10:14, 10:16] = 3
    return segmap


def write_published(folder, entries, views=2):
    folder.mkdir(parents=True)
    (folder / "objects.json").write_text(json.dumps(entries))
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = 2 * H / W, 2.0
    projection[2, 2:] = -(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
    projection[3, 2] = -1
    view = np.eye(4)
    view[2, 3] = -HEIGHT
    buffer = FAR / (FAR - NEAR) * (1 - NEAR / HEIGHT)
    for i in range(views):
        place = folder / f"{i:04d}"
        place.mkdir()
        Image.new("RGB", (W, H), "red").save(place / "rgb.jpg")
        np.save(place / "depth.npy", np.full((H, W), buffer, dtype=np.float32))
        np.save(place / "seg_mask.npy", mask())
        np.savez(place / "camera.npz", projection_matrix=projection, view_matrix=view)


def write_npz(path, entries, pose=T_WORLD_CAM, segmap=None):
    K = [[24.0, 0, W / 2], [0, 24.0, H / 2], [0, 0, 1]]
    arrays = {} if pose is None else {"T_world_cam": pose}
    np.savez(
        path,
        depth=np.full((H, W), HEIGHT),
        K=K,
        rgb=np.zeros((H, W, 3), np.uint8),
        segmap=np.maximum(mask(), 0) if segmap is None else segmap,
        **arrays,
    )
    path.with_suffix("").with_suffix(".truth.json").write_text(json.dumps(entries))


@pytest.fixture
def data_root(tmp_path):
    path = tmp_path / "data" / "ycb" / "011_banana" / "google_16k" / "textured.obj"
    path.parent.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.4)).export(path)
    return tmp_path / "data"


def test_scenes_of_both_layouts_are_found_by_name(tmp_path):
    write_published(tmp_path / "s" / "00000001", [entry()])
    write_published(tmp_path / "s" / "00000000", [entry()], views=3)
    write_npz(tmp_path / "s" / "desk.npz", [entry()])
    (tmp_path / "s" / "notes.txt").write_text("not a scene")
    np.savez(tmp_path / "s" / "no_truth.npz", depth=np.ones((2, 2)))

    scenes = find_scenes(tmp_path / "s")
    assert [s.name for s in scenes] == ["00000000", "00000001", "desk"]
    assert [len(s.views) for s in scenes] == [3, 2, 1]
    assert [s.name for s in find_scenes(tmp_path / "s", slice(1, 3))] == ["00000001", "desk"]
    assert [s.name for s in find_scenes(tmp_path / "s" / "00000001")] == ["00000001"]
    assert [s.name for s in find_scenes(tmp_path / "s" / "desk.npz")] == ["desk"]


def test_both_layouts_give_the_same_world_points_and_objects_only(tmp_path):
    write_published(tmp_path / "s" / "a", [entry()])
    write_npz(tmp_path / "s" / "b.npz", [entry()])
    for scene in find_scenes(tmp_path / "s"):
        frame = scene.view(0)
        assert frame.object_ids == [3]
        seen = transform_points(frame.T_world_cam, frame.object_points(3).astype(np.float64))
        # Row 12 is the image's centre; rows above it are at positive y.
        assert seen[:, 2] == pytest.approx(0, abs=1e-5)
        assert seen[:, 0].min() == pytest.approx((10 - 16) / 24, abs=1e-5)
        assert seen[:, 1].max() == pytest.approx((12 - 10) / 24, abs=1e-5)


def test_true_ids_tell_the_background_whatever_the_masks_mark_it_with(tmp_path):
    write_npz(tmp_path / "a.npz", [entry()], segmap=mask())
    write_npz(tmp_path / "b.npz", [entry()], segmap=np.where(mask() == 3, 3, 7))
    for scene in find_scenes(tmp_path):
        frame = scene.view(0)
        assert frame.object_ids == [3] and (frame.segmap == 3).sum() == 24
        with pytest.raises(FrameError, match=r"no object|no background"):
            load_frame(scene.folder)


def test_true_mesh_is_scaled_turned_and_moved(tmp_path, data_root):
    write_published(tmp_path / "s" / "a", [entry()])
    (scene,) = find_scenes(tmp_path / "s")
    truth = scene.object(3)
    assert truth.name == "011_banana"
    mesh = true_mesh(truth, data_root)
    # 0.1 x 0.2 x 0.4, doubled, x and y exchanged by the quarter turn.
    np.testing.assert_allclose(mesh.extents, [0.4, 0.2, 0.8], atol=1e-6)
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), [0.1, 0.2, 0.3], atol=1e-6)
    assert mesh.is_volume
    in_camera = true_mesh_in_camera(truth, data_root, scene.view(0).T_world_cam)
    np.testing.assert_allclose(in_camera.bounds.mean(axis=0), [0.1, -0.2, 0.7], atol=1e-6)


def test_missing_mesh_and_data_root_are_told(tmp_path, data_root):
    write_published(tmp_path / "s" / "a", [entry(), entry(4, mesh_path="ycb/none.obj")])
    (scene,) = find_scenes(tmp_path / "s")
    with pytest.raises(SceneError, match=r"pass --data-root"):
        true_mesh(scene.object(3), None)
    with pytest.raises(SceneError, match=r"No such data folder(.|\n)*elsewhere(.|\n)*--data-root"):
        true_mesh(scene.object(3), tmp_path / "elsewhere")
    with pytest.raises(SceneError, match=r"ycb/none.obj(.|\n)*--data-root"):
        true_mesh(scene.object(4), data_root)
    (data_root / "ycb" / "none.obj").write_text("v 0 0 nothing\n")
    with pytest.raises(SceneError, match=r"none.obj"):
        true_mesh(scene.object(4), data_root)
    with pytest.raises(SceneError, match=r"no object of that id(.|\n)*\[3, 4\](.|\n)*found: +9"):
        scene.object(9)
    with pytest.raises(SceneError, match=r"no such view(.|\n)*0 to 1"):
        scene.view(2)


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"id": 1}, "Not a list"),
        ([3], "entry 0"),
        ([entry(), {k: v for k, v in entry(4).items() if k != "scale"}], "entry 1(.|\n)*scale"),
        ([entry(id="3")], "id(.|\n)*an integer"),
        ([entry(mesh_path=None)], "mesh_path"),
        ([entry(position=[0, 1])], "position(.|\n)*3 numbers"),
        ([entry(orientation=[0, 0, 0, 0])], "orientation(.|\n)*quaternion"),
        ([entry(orientation=[0, 0, "x", 1])], "orientation(.|\n)*quaternion"),
        ([entry(scale=[1, 1, 2])], "scale(.|\n)*one positive"),
        ([entry(scale=0)], "scale(.|\n)*one positive"),
        ([entry(), entry()], r"one id(.|\n)*\[3, 3\]"),
    ],
)
def test_bad_truth_names_file_entry_and_key(tmp_path, entries, told):
    write_published(tmp_path / "s" / "a", entries)
    with pytest.raises(SceneError, match=told) as error:
        find_scenes(tmp_path / "s")
    assert "objects.json" in str(error.value)
    assert_for_people(error.value)


def test_equal_scale_of_each_axis_is_one_scale(tmp_path):
    write_published(tmp_path / "s" / "a", [entry(scale=[2, 2, 2])])
    T = find_scenes(tmp_path / "s")[0].objects[0].T_world_object
    np.testing.assert_allclose(T[:3, :3], [[0, -2, 0], [2, 0, 0], [0, 0, 2]], atol=1e-12)


def test_nothing_to_evaluate_is_told(tmp_path):
    with pytest.raises(SceneError, match="no such folder"):
        find_scenes(tmp_path / "none")
    with pytest.raises(SceneError, match="an empty folder"):
        find_scenes(tmp_path)
    (tmp_path / "s" / "a").mkdir(parents=True)
    (tmp_path / "s" / "a" / "objects.json").write_text("[]")
    with pytest.raises(SceneError, match="no views"):
        find_scenes(tmp_path / "s")
    (tmp_path / "s" / "a" / "0000").mkdir()
    with pytest.raises(SceneError, match=r"part of 0:1(.|\n)*4:9"):
        find_scenes(tmp_path / "s", slice(4, 9))


def test_mask_of_another_scene_is_refused(tmp_path):
    write_npz(tmp_path / "a.npz", [entry(5)])
    with pytest.raises(SceneError, match=r"No id of the mask(.|\n)*\[5\](.|\n)*\[3, 7\]"):
        find_scenes(tmp_path)[0].view(0)


def test_frame_file_needs_its_camera_pose(tmp_path):
    write_npz(tmp_path / "a.npz", [entry()], pose=None)
    with pytest.raises(FrameError, match=r"no camera pose(.|\n)*T_world_cam"):
        find_scenes(tmp_path)[0].view(0)
