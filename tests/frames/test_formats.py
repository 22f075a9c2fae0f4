"""Formats of other people, written as their programs write them, and read back."""

from __future__ import annotations

import io
import json
import logging
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from brrp_cli.cli import main
from brrp_cli.errors import FrameError
from brrp_cli.frames import formats
from brrp_cli.frames.format import FrameRequest
from brrp_cli.frames.readers import known_formats, matching, read_frame
from brrp_cli.frames.ros_images import colour_of, depth_of, frame_of

IDS = {7: 1, 250: 2, -3: 3}


def write_images(color: Path, depth: Path, scene, units: float) -> None:
    """Colour, and 16-bit depth of `units` to the metre, 0 where there is no return."""
    for path in (color, depth):
        path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(scene.rgb).save(color)
    z = np.where(np.isfinite(scene.depth), scene.depth, 0)
    Image.fromarray((z * units).round().astype(np.uint16)).save(depth)


def assert_the_scene(frame, scene, tolerance=6e-4):
    seen = np.isfinite(scene.depth)
    assert pytest.approx(scene.K, abs=1e-3) == frame.K
    assert np.array_equal(frame.valid, seen)
    assert frame.points[seen][:, 2] == pytest.approx(scene.depth[seen], abs=tolerance)


def write_bop(folder: Path, scene, *, masks=True) -> Path:
    """A data set of one scene with the images 3 and 12, the second a little darker."""
    place = folder / "test" / "000048"
    cameras, truth = {}, {}
    for image in (3, 12):
        rgb, depth = (place / kind / f"{image:06d}.png" for kind in ("rgb", "depth"))
        write_images(rgb, depth, scene, 10_000)
        world = np.linalg.inv(scene.T_world_cam)
        cameras[str(image)] = {
            "cam_K": scene.K.ravel().tolist(),
            "depth_scale": 0.1,
            "cam_R_w2c": world[:3, :3].ravel().tolist(),
            "cam_t_w2c": (world[:3, 3] * 1000).tolist(),
        }
        truth[str(image)] = [
            {
                "cam_R_m2c": np.eye(3).ravel().tolist(),
                "cam_t_m2c": [10.0 * number, 20.0, 700.0],
                "obj_id": number + 1,
            }
            for number in range(3)
        ]
        for name, number in IDS.items():
            mask = place / "mask_visib" / f"{image:06d}_{number - 1:06d}.png"
            if masks:
                mask.parent.mkdir(exist_ok=True)
                Image.fromarray((scene.segmap == name).astype(np.uint8) * 255).save(mask)
    Image.fromarray(scene.rgb // 2).save(place / "rgb" / "000012.png")
    (place / "scene_camera.json").write_text(json.dumps(cameras))
    (place / "scene_gt.json").write_text(json.dumps(truth))
    return folder


def test_every_format_has_a_name_and_a_layout():
    assert len(known_formats()) >= 9
    assert len({one.title for one in known_formats()}) == len(known_formats())
    assert all(one.layout for one in known_formats())


MINE = """
from brrp_cli.frames.format import Format
from brrp_cli.frames.images import read_images

def read(folder, request):
    parts = (folder / "color" / "0.png", folder / "depth" / "0.png", folder / "mine.json")
    return read_images(*parts, depth_scale=0.0005)

FORMAT = Format("my recorder", "mine.json", lambda path: (path / "mine.json").is_file(), read)
"""


def test_a_new_format_is_one_new_file(scene, tmp_path, monkeypatch):
    """Though its folders are those that any folder of frames may have."""
    home, dump = tmp_path / "home", tmp_path / "dump"
    home.mkdir()
    (home / "made_for_this_test.py").write_text(MINE)
    write_images(dump / "color" / "0.png", dump / "depth" / "0.png", scene, 2000)
    (dump / "mine.json").write_text(json.dumps({"K": scene.K.tolist()}))
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(home)])
    known_formats.cache_clear()
    try:
        assert_the_scene(read_frame(dump), scene)
        (tmp_path / "none").mkdir()
        arguments = ["frame", str(tmp_path / "none"), "-o", str(tmp_path / "f.npz")]
        result = CliRunner().invoke(main, arguments)
        assert "my recorder (mine.json)" in result.output, "what is known is listed"
    finally:
        known_formats.cache_clear()
        sys.modules.pop(f"{formats.__name__}.made_for_this_test", None)


@pytest.mark.parametrize("below", ["", "test", "test/000048"])
def test_a_bop_image_has_its_visible_masks_and_its_camera(scene, tmp_path, below):
    frame = read_frame(write_bop(tmp_path, scene) / below)
    assert_the_scene(frame, scene, 1e-4)
    assert frame.T_world_cam == pytest.approx(scene.T_world_cam, abs=1e-9)
    for name, number in IDS.items():
        assert np.array_equal(frame.segmap == number, scene.segmap == name)


def test_bop_images_go_by_their_number(scene, tmp_path):
    write_bop(tmp_path, scene)
    dark = read_frame(tmp_path, request=FrameRequest(index="000048/12"))
    assert np.array_equal(dark.rgb, scene.rgb // 2)
    assert np.array_equal(
        read_frame(tmp_path / "test/000048", request=FrameRequest(index="12")).rgb, dark.rgb
    )
    with pytest.raises(FrameError, match=r"no such image(.|\n)*3, 12"):
        read_frame(tmp_path, request=FrameRequest(index="000048/0"))
    with pytest.raises(FrameError, match="--depth-scale means nothing here"):
        read_frame(tmp_path, depth_scale=0.001)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda folder: (folder / "scene_camera.json").write_text("{"), "cannot be read"),
        (lambda folder: (folder / "scene_camera.json").write_text('{"3": {}}'), "no camera"),
        (lambda folder: (folder / "depth/000003.png").unlink(), "file is missing"),
    ],
)
def test_a_damaged_bop_scene_is_told(scene, tmp_path, change, message):
    change(write_bop(tmp_path, scene) / "test/000048")
    with pytest.raises(FrameError, match=message):
        read_frame(tmp_path)


def write_tum(folder: Path, scene) -> Path:
    for time, near in (
        ("1305031102.175304", "1305031102.160407"),
        ("1305031102.9", "1305031102.8"),
    ):
        write_images(folder / f"rgb/{time}.png", folder / f"depth/{near}.png", scene, 5000)
    (folder / "rgb.txt").write_text(
        "# color images\n# timestamp filename\n"
        "1305031102.175304 rgb/1305031102.175304.png\n1305031102.9 rgb/1305031102.9.png\n"
    )
    (folder / "depth.txt").write_text(
        "# depth maps\n1305031102.160407 depth/1305031102.160407.png\n"
        "1305031102.8 depth/1305031102.8.png\n"
    )
    (folder / "groundtruth.txt").write_text(
        "# timestamp tx ty tz qx qy qz qw\n1305031102.1758 1.5 0.25 1.0 0 0 0.70710678 0.70710678\n"
    )
    return folder


def test_a_tum_sequence_has_5000_units_to_the_metre_and_poses(scene, tmp_path, caplog):
    folder = write_tum(tmp_path / "rgbd_dataset_freiburg1_desk", scene)
    with caplog.at_level(logging.INFO):
        frame = read_frame(folder)
    assert frame.valid.sum() == np.isfinite(scene.depth).sum()
    seen = np.isfinite(scene.depth)
    assert frame.points[seen][:, 2] == pytest.approx(scene.depth[seen], abs=2e-4)
    assert frame.K[0, 0] == 517.3
    assert "freiburg1" in caplog.text
    assert frame.T_world_cam[:3, 3].tolist() == [1.5, 0.25, 1.0]
    # A quarter turn about z: what is right of the camera lies along y.
    assert frame.T_world_cam[:3, 0] == pytest.approx([0, 1, 0], abs=1e-6)


def test_tum_images_without_depth_near_them_are_left_out(scene, tmp_path):
    folder = write_tum(tmp_path / "freiburg1", scene)
    with pytest.raises(FrameError, match=r"no such frame(.|\n)*0 to 0"):
        read_frame(folder, request=FrameRequest(index="1"))


def test_tum_intrinsics_are_never_guessed(scene, tmp_path):
    folder = write_tum(tmp_path / "desk", scene)
    with pytest.raises(FrameError, match="--intrinsics"):
        read_frame(folder)
    k = tmp_path / "k.json"
    k.write_text(json.dumps({"K": scene.K.tolist()}))
    assert_the_scene(read_frame(folder, request=FrameRequest(intrinsics=k)), scene)


@pytest.mark.parametrize(
    ("intrinsics", "digits", "title"),
    [("camera_intrinsic.json", 6, "RealSense"), ("intrinsic.json", 5, "Azure Kinect")],
)
def test_recordings_of_open3d_are_read(scene, tmp_path, caplog, intrinsics, digits, title):
    for number in range(2):
        name = f"{number:0{digits}d}"
        write_images(tmp_path / f"color/{name}.jpg", tmp_path / f"depth/{name}.png", scene, 1000)
    matrix = scene.K.T.ravel().tolist()  # column by column
    (tmp_path / intrinsics).write_text(
        json.dumps({"width": 160, "height": 120, "intrinsic_matrix": matrix})
    )
    with caplog.at_level(logging.INFO):
        frame = read_frame(tmp_path, request=FrameRequest(index="1"))
    assert_the_scene(frame, scene)
    assert "millimetres" in caplog.text
    assert [title in one.title for one in matching(tmp_path)] == [True]
    quarter = read_frame(tmp_path, depth_scale=0.00025)
    assert quarter.points[frame.valid][:, 2] == pytest.approx(
        scene.depth[frame.valid] / 4, abs=1e-3
    )
    (tmp_path / "depth" / f"{1:0{digits}d}.png").unlink()
    with pytest.raises(FrameError, match="no such frame"):
        read_frame(tmp_path, request=FrameRequest(index="1"))


@pytest.mark.parametrize(
    ("color", "depth"),
    [
        ("color.png", "depth.png"),
        ("frame-000000.color.png", "frame-000000.depth.png"),
        ("000000-rgb.jpg", "000000-depth.png"),
        ("rgb/a.png", "depth/a.png"),
    ],
)
@pytest.mark.parametrize("camera", ["camera_params.json", "../intrinsics.json"])
def test_a_folder_of_frames_is_read_with_the_one_camera_file(scene, tmp_path, color, depth, camera):
    folder = tmp_path / "recording" / "000000"
    write_images(folder / color, folder / depth, scene, 1000)
    fx, fy, cx, cy = scene.K[0, 0], scene.K[1, 1], scene.K[0, 2], scene.K[1, 2]
    (folder / camera).write_text(json.dumps({"fx": fx, "fy": fy, "x_offset": cx, "y_offset": cy}))
    assert_the_scene(read_frame(folder), scene)


def test_a_folder_with_no_camera_file_or_several_is_refused(scene, tmp_path):
    folder = tmp_path / "a" / "b"
    write_images(folder / "color.png", folder / "depth.png", scene, 1000)
    with pytest.raises(FrameError, match="No intrinsics"):
        read_frame(folder)
    for name in ("camera.json", "intrinsics.json"):
        (folder / name).write_text("{}")
    with pytest.raises(FrameError, match=r"Several files(.|\n)*camera\.json, intrinsics\.json"):
        read_frame(folder)


def test_contact_graspnets_npz_may_have_k_flat_and_its_npy_is_not_loaded(scene, tmp_path):
    depth = np.where(np.isfinite(scene.depth), scene.depth, 0).astype(np.float32)
    np.savez(tmp_path / "0.npz", depth=depth, K=scene.K.ravel(), rgb=scene.rgb, segmap=scene.segmap)
    frame = read_frame(tmp_path / "0.npz")
    assert_the_scene(frame, scene)
    assert frame.object_ids == [-3, 7, 250]
    np.save(tmp_path / "0.npy", {"depth": depth, "K": scene.K}, allow_pickle=True)
    with pytest.raises(FrameError, match=r"never loaded(.|\n)*np\.savez"):
        read_frame(tmp_path / "0.npy")


def image(array, encoding, *, pad=0, stamp=0, big=False):
    """What sensor_msgs/Image holds, its rows `pad` bytes longer than the image."""
    array = np.ascontiguousarray(array)
    rows = array.reshape(array.shape[0], -1).view(np.uint8)
    rows = np.pad(rows, ((0, 0), (0, pad)))
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=stamp, nanosec=0), frame_id="camera"),
        height=array.shape[0], width=array.shape[1], encoding=encoding, is_bigendian=big,
        step=rows.shape[1], data=rows.tobytes(),
    )  # fmt: skip


def info(scene):
    return SimpleNamespace(k=scene.K.ravel(), width=160, height=120)


def test_image_messages_of_every_encoding_are_the_same_frame(scene):
    z = np.where(np.isfinite(scene.depth), scene.depth, 0)
    millimetres = (z * 1000).round().astype(np.uint16)
    bgra = np.concatenate([scene.rgb[..., ::-1], scene.rgb[..., :1]], axis=-1)
    colours = [
        image(scene.rgb, "rgb8", pad=3), image(scene.rgb[..., ::-1], "bgr8"), image(bgra, "bgra8"),
    ]  # fmt: skip
    depths = [
        image(millimetres, "16UC1", pad=2),
        image(scene.depth.astype(np.float32), "32FC1"),
        image(millimetres.astype(">u2"), "mono16", big=True),
    ]
    for colour, depth in zip(colours, depths, strict=True):
        frame = frame_of(colour, depth, info(scene))
        assert np.array_equal(frame.rgb, scene.rgb)
        assert_the_scene(frame, scene)


def test_compressed_messages_are_decoded(scene):
    millimetres = np.arange(12, dtype=np.uint16).reshape(3, 4) * 1000
    buffer = io.BytesIO()
    Image.fromarray(millimetres).save(buffer, "png")
    depth = SimpleNamespace(
        format="16UC1; compressedDepth png", data=b"\0" * 12 + buffer.getvalue()
    )
    assert np.array_equal(depth_of(depth), millimetres)
    with pytest.raises(FrameError, match="one wide number a pixel"):
        colour_of(SimpleNamespace(format="mono16; png compressed", data=buffer.getvalue()))
    buffer = io.BytesIO()
    Image.fromarray(scene.rgb).save(buffer, "png")
    colour = SimpleNamespace(format="rgb8; png compressed rgb8", data=buffer.getvalue())
    assert np.array_equal(colour_of(colour), scene.rgb)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c, d, i: setattr(c, "encoding", "bayer_rggb8"), "Unknown image encoding"),
        (lambda c, d, i: setattr(d, "data", d.data[:-9]), "cut short"),
        (lambda c, d, i: setattr(i, "width", 640), r"sizes disagree(.|\n)*align"),
        (lambda c, d, i: setattr(i, "k", np.zeros(9)), "not calibrated"),
    ],
)
def test_messages_that_are_no_frame_are_told(scene, change, message):
    parts = image(scene.rgb, "rgb8"), image(scene.depth.astype(np.float32), "32FC1"), info(scene)
    change(*parts)
    with pytest.raises(FrameError, match=message):
        frame_of(*parts)
