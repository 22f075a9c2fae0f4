"""Sources of many frames: their names, and that each name reads the frame that it is of."""

from __future__ import annotations

import json

import numpy as np
import pytest
import scipy.io
from for_people import assert_for_people
from PIL import Image
from test_formats import assert_the_scene, write_bop, write_images

from brrp_cli.errors import FrameError
from brrp_cli.frames.format import FrameRequest
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import save_frame
from brrp_cli.frames.readers import list_frames, read_frame
from brrp_cli.geometry import backproject


def write_graspnet(root, scene, *, cameras=("kinect", "realsense"), views=2):
    """A data set of one scene, as graspnetAPI reads it; view 1 is darker. The first camera stands
    anywhere above the table."""
    T_table_cam0 = scene.T_world_cam @ np.array(
        [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]
    )
    for camera in cameras:
        place = root / "scenes" / "scene_0007" / camera
        for name in ("label", "meta"):
            (place / name).mkdir(parents=True)
        for view in range(views):
            files = (place / kind / f"{view:04d}.png" for kind in ("rgb", "depth"))
            write_images(*files, scene, 2000)
            ids = np.select([scene.segmap == i for i in (7, 250, -3)], [1, 20, 88], 0)
            Image.fromarray(ids.astype(np.uint8)).save(place / "label" / f"{view:04d}.png")
            meta = {"intrinsic_matrix": scene.K, "factor_depth": np.array([[2000]])}
            scipy.io.savemat(place / "meta" / f"{view:04d}.mat", {**meta, "poses": np.zeros(3)})
        Image.fromarray(scene.rgb // 2).save(place / "rgb" / "0001.png")
        relative = np.linalg.inv(T_table_cam0) @ scene.T_world_cam
        np.save(place / "camera_poses.npy", np.stack([relative] * views))
        np.save(place / "cam0_wrt_table.npy", T_table_cam0)
    return root


def test_graspnets_layout_is_read_from_any_height(scene, tmp_path):
    root = write_graspnet(tmp_path / "graspnet", scene)
    assert list_frames(root) == [
        f"scene_0007/{camera}/{view}"
        for camera in ("kinect", "realsense")
        for view in ("0000", "0001")
    ]
    assert list_frames(root / "scenes" / "scene_0007")[0] == "kinect/0000"
    camera = root / "scenes" / "scene_0007" / "realsense"
    assert list_frames(camera) == ["0000", "0001"]
    frame = read_frame(root)
    assert_the_scene(frame, scene)
    assert frame.T_world_cam == pytest.approx(scene.T_world_cam, abs=1e-9)
    assert frame.object_ids == [1, 20, 88]
    assert np.array_equal(frame.segmap == 20, scene.segmap == 250)
    darker = read_frame(root, request=FrameRequest(index="scene_0007/realsense/0001"))
    assert np.array_equal(darker.rgb, scene.rgb // 2)
    with pytest.raises(FrameError, match=r"no such frame(.|\n)*scene_0007"):
        read_frame(root, request=FrameRequest(index="scene_0008/kinect/0000"))


def test_graspnets_example_of_one_frame_is_read_with_its_meta(scene, tmp_path):
    """color.png, depth.png and meta.mat, as its baseline ships one; also named one by one."""
    from brrp_cli.frames.images import read_images

    write_images(tmp_path / "color.png", tmp_path / "depth.png", scene, 2000)
    meta = {"intrinsic_matrix": scene.K, "factor_depth": np.array([[2000.0]])}
    scipy.io.savemat(tmp_path / "meta.mat", meta)
    assert_the_scene(read_frame(tmp_path), scene)
    files = (tmp_path / name for name in ("color.png", "depth.png", "meta.mat"))
    assert_the_scene(read_images(*files), scene)


@pytest.mark.parametrize(
    ("meta", "says"),
    [
        ({"intrinsic_matrix": np.eye(4), "factor_depth": 1000}, "no intrinsic_matrix"),
        ({"intrinsic_matrix": np.eye(3)}, "no factor_depth"),
        ({"intrinsic_matrix": np.eye(3), "factor_depth": 0}, "no positive number"),
        ({"intrinsic_matrix": np.eye(3), "factor_depth": "mm"}, "no factor_depth"),
        (b"MATLAB 5.0 MAT-file, cut", "cannot be read"),
    ],
)
def test_a_meta_that_is_none_is_told(meta, says, scene, tmp_path):
    write_images(tmp_path / "color.png", tmp_path / "depth.png", scene, 1000)
    path = tmp_path / "meta.mat"
    if isinstance(meta, bytes):
        path.write_bytes(meta)
    else:
        scipy.io.savemat(path, meta)
    with pytest.raises(FrameError, match=says) as caught:
        read_frame(tmp_path)
    assert_for_people(caught.value)


def test_names_of_every_format_read_the_frames_that_they_are_of(scene, tmp_path):
    bop = write_bop(tmp_path / "bop", scene)
    assert list_frames(bop) == ["000048/3", "000048/12"]
    assert list_frames(bop / "test" / "000048") == ["3", "12"]
    recording = tmp_path / "recording"
    for name in ("a", "b"):
        files = (recording / kind / f"{name}.png" for kind in ("color", "depth"))
        write_images(*files, scene, 1000)
    Image.fromarray(scene.rgb // 2).save(recording / "color" / "b.png")
    (recording / "camera_intrinsic.json").write_text(json.dumps({"K": scene.K.tolist()}))
    assert list_frames(recording) == ["a", "b"]
    frame = Frame(scene.rgb // 3, backproject(scene.depth, scene.K), scene.segmap, scene.K)
    save_frame(frame, tmp_path / "one.npz")
    assert list_frames(tmp_path / "one.npz") == ["one"]

    # All of them in one folder: each under its own name.
    (tmp_path / "notes.txt").touch()
    every = ["bop/000048/3", "bop/000048/12", "one.npz", "recording/a", "recording/b"]
    assert list_frames(tmp_path) == every
    by_name = [read_frame(tmp_path, request=FrameRequest(index=name)).rgb for name in every]
    by_number = [read_frame(tmp_path, request=FrameRequest(index=str(i))).rgb for i in range(5)]
    expected = [scene.rgb, scene.rgb // 2, scene.rgb // 3, scene.rgb, scene.rgb // 2]
    for named, counted, right in zip(by_name, by_number, expected, strict=True):
        assert np.array_equal(named, right) and np.array_equal(counted, right)
    with pytest.raises(FrameError, match="no such frame"):
        read_frame(tmp_path, request=FrameRequest(index="5"))


def test_an_array_that_lies_beside_frames_is_none_of_them(scene, tmp_path):
    frame = Frame(scene.rgb, backproject(scene.depth, scene.K), scene.segmap, scene.K)
    save_frame(frame, tmp_path / "a.npz")
    np.save(tmp_path / "depth.npy", scene.depth)
    assert list_frames(tmp_path) == ["a.npz"]
    assert np.array_equal(read_frame(tmp_path).segmap, frame.segmap)
    (tmp_path / "only").mkdir()
    np.save(tmp_path / "only" / "depth.npy", scene.depth)
    with pytest.raises(FrameError):
        list_frames(tmp_path / "only")
