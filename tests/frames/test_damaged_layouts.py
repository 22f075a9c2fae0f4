"""Layouts of other people, of which one file is anything at all: a frame, or a FrameError."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from for_people import assert_for_people
from PIL import Image
from test_formats import image, info, write_bop, write_images, write_tum

from brrp_cli.errors import BrrpError, FrameError, SceneError
from brrp_cli.frames.format import FrameRequest
from brrp_cli.frames.readers import read_frame
from brrp_cli.frames.ros_images import frame_of
from brrp_cli.ground_truth.scenes import find_scenes

LONG = "x" * 400
HARMFUL = {
    "empty": b"",
    "a bracket": b"{",
    "a list": b"[]",
    "an object": b"{}",
    "null": b"null",
    "endless brackets": b"[" * 100_000,
    "no number": b'{"a": {}}',
    "null for an image": b'{"3": null}',
    "a list for an image": b'{"3": [[], null, 7]}',
    "400 digits": b'{"' + 400 * b"9" + b'": {}}',
    "an integer of 400 digits": b'{"3": ' + 400 * b"9" + b"}",
    "no text": b"\xff\xfe\x00",
    "a long name": f"1305031102.175304 {LONG}\n".encode(),
    "a name with a zero": b"1305031102.175304 a\x00b\n",
    "no time": b"nan rgb/1.png\ninf rgb/2.png\n",
    "no turn": b"1305031102.1758 1 1 1 0 0 0 0\n",
    "a turn that is no number": b"1305031102.1758 1 1 1 nan 0 0 1\n",
    "no numbers": b"a b c d e f g h\n",
    "numbers": b"1 2 3\n4 5 6\n",
}
VALUES = [None, True, "a", "", [], {}, -1, 0, 1e300, float("nan"), float("inf"), [0] * 9, [[1], 2]]


@pytest.fixture
def layouts(scene, tmp_path: Path) -> dict[str, Path]:
    """A folder of each layout, with the files that are made harmful."""
    bop = write_bop(tmp_path / "bop", scene) / "test/000048"
    (tmp_path / "bop/models").mkdir()
    tum = write_tum(tmp_path / "freiburg1", scene)
    recording = tmp_path / "recording"
    write_images(recording / "color/000000.jpg", recording / "depth/000000.png", scene, 1000)
    matrix = scene.K.T.ravel().tolist()
    (recording / "camera_intrinsic.json").write_text(json.dumps({"intrinsic_matrix": matrix}))
    return {"bop": bop, "tum": tum, "recording": recording}


@pytest.mark.parametrize(
    ("layout", "name"),
    [
        ("bop", "scene_camera.json"),
        ("bop", "scene_gt.json"),
        ("tum", "rgb.txt"),
        ("tum", "depth.txt"),
        ("tum", "groundtruth.txt"),
        ("recording", "camera_intrinsic.json"),
    ],
)
def test_a_file_that_is_anything_is_read_or_refused(layouts, layout: str, name: str) -> None:
    folder = layouts[layout]
    read_frame(folder)
    refused = 0
    for data in HARMFUL.values():
        (folder / name).write_bytes(data)
        for read in (read_frame, find_scenes):
            try:
                read(folder)
            except BrrpError as error:
                refused += 1
                assert str(folder) in str(error)
                assert_for_people(error)
    # Neither the truth nor the poses are needed for a frame.
    assert refused >= len(HARMFUL)


@pytest.mark.parametrize("key", ["cam_K", "depth_scale", "cam_R_w2c", "cam_t_w2c"])
def test_a_bop_camera_with_any_value_is_read_or_refused(layouts, key: str) -> None:
    path = layouts["bop"] / "scene_camera.json"
    table = json.loads(path.read_text())
    for value in VALUES:
        path.write_text(json.dumps({"3": {**table["3"], key: value}}))
        try:
            frame = read_frame(path.parent)
        except FrameError as error:
            assert_for_people(error)
            continue
        assert np.isfinite(frame.K).all() and np.isfinite(frame.points[frame.valid]).all()
        assert frame.T_world_cam is None or np.isfinite(frame.T_world_cam).all()


@pytest.mark.parametrize("key", ["cam_R_m2c", "cam_t_m2c", "obj_id"])
def test_a_bop_truth_with_any_value_is_read_or_refused(layouts, key: str) -> None:
    path = layouts["bop"] / "scene_gt.json"
    table = json.loads(path.read_text())
    for value in VALUES:
        table["3"][0][key] = value
        path.write_text(json.dumps(table))
        try:
            scenes = find_scenes(path.parent)
        except (FrameError, SceneError) as error:
            assert_for_people(error)
            continue
        assert all(np.isfinite(o.T_world_object).all() for s in scenes for o in s.objects)


def test_a_mask_whose_name_tells_no_number_is_told(layouts) -> None:
    Image.new("L", (160, 120)).save(layouts["bop"] / "mask_visib/000003_left.png")
    for read in (read_frame, find_scenes):
        with pytest.raises(FrameError, match="tells no numbers"):
            read(layouts["bop"])


@pytest.mark.parametrize("index", ["abc", "²", "-1", "", 5000 * "9", "000048/x", "/"])
def test_an_index_that_is_none_is_told(layouts, index: str) -> None:
    for folder in (*layouts.values(), layouts["bop"].parents[1]):
        with pytest.raises(FrameError, match=r"no such (frame|image)"):
            read_frame(folder, request=FrameRequest(index=index))


def test_a_compressed_image_of_a_billion_pixels_is_refused_unread(scene) -> None:
    """A PNG's header may tell any size; what it unpacks to is never made."""
    size = (2**15).to_bytes(4, "big")
    chunk = b"IHDR" + size + size + b"\x08\x02\x00\x00\x00"
    data = b"\x89PNG\r\n\x1a\n\x00\x00\x00\r" + chunk + zlib.crc32(chunk).to_bytes(4, "big")
    color = SimpleNamespace(format="rgb8; png compressed", data=data)
    with pytest.raises(FrameError, match="image"):
        frame_of(color, image(scene.depth.astype(np.float32), "32FC1"), info(scene))
