"""Every layout that people have, written and read back."""

from __future__ import annotations

import json
import logging

import numpy as np
import pytest
from for_people import assert_for_people
from PIL import Image

from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.images import read_images
from brrp_cli.frames.intrinsics import read_intrinsics
from brrp_cli.frames.npz import save_frame
from brrp_cli.frames.published import read_published
from brrp_cli.frames.readers import read_frame
from brrp_cli.geometry import transform_points

NEAR, FAR = 0.05, 10.0


def opengl_projection(K, width, height):
    """The projection matrix of K, for pixels (u, v) at (-1 + 2u/W, 1 - 2v/H)."""
    return np.array(
        [
            [2 * K[0, 0] / width, 0, 1 - 2 * K[0, 2] / width, 0],
            [0, 2 * K[1, 1] / height, 2 * K[1, 2] / height - 1, 0],
            [0, 0, (FAR + NEAR) / (NEAR - FAR), 2 * FAR * NEAR / (NEAR - FAR)],
            [0, 0, -1, 0],
        ]
    )


@pytest.fixture
def view(scene, tmp_path):
    """A view folder of the published layout."""
    folder = tmp_path / "00000000" / "0000"
    folder.mkdir(parents=True)
    height, width = scene.depth.shape
    projection = opengl_projection(scene.K, width, height)
    depth = np.where(np.isfinite(scene.depth), scene.depth, FAR)
    buffer = ((-projection[2, 2] * depth + projection[2, 3]) / depth + 1) / 2
    Image.fromarray(scene.rgb).save(folder / "rgb.jpg")
    np.save(folder / "depth.npy", np.where(np.isfinite(scene.depth), buffer, 1.0))
    view = np.linalg.inv(scene.T_world_cam @ np.diag([1, -1, -1, 1]))
    np.savez(folder / "camera.npz", projection_matrix=projection, view_matrix=view)
    np.save(folder / "seg_mask.npy", np.where(scene.segmap == -3, 3, scene.segmap))
    return folder


def test_a_published_view_is_the_camera_that_made_it(scene, view):
    frame = read_frame(view)
    assert pytest.approx(scene.K, abs=1e-9) == frame.K
    assert frame.T_world_cam == pytest.approx(scene.T_world_cam, abs=1e-9)
    seen = np.isfinite(scene.depth)
    assert np.array_equal(frame.valid, seen)
    assert frame.points[seen][:, 2] == pytest.approx(scene.depth[seen], abs=1e-5)
    assert frame.object_ids == [3, 7, 250]


def test_world_points_follow_the_published_formula(view):
    frame = read_published(view)
    camera, buffer = np.load(view / "camera.npz"), np.load(view / "depth.npy")
    height, width = buffer.shape
    v, u = np.mgrid[:height, :width]
    device = np.stack(
        [-1 + 2 * u / width, 1 - 2 * v / height, 2 * buffer - 1, np.ones_like(buffer)], axis=-1
    )
    inverse = np.linalg.inv(camera["projection_matrix"] @ camera["view_matrix"])
    world = device @ inverse.T
    world = world[..., :3] / world[..., 3:]
    ours = transform_points(frame.T_world_cam, frame.points)
    assert ours[frame.valid] == pytest.approx(world[frame.valid], abs=1e-5)


def test_matrices_in_opengls_memory_order_are_understood(scene, view):
    camera = np.load(view / "camera.npz")
    np.savez(view / "camera.npz", **{name: camera[name].T.ravel() for name in camera.files})
    frame = read_published(view)
    assert pytest.approx(scene.K, abs=1e-9) == frame.K
    assert frame.T_world_cam == pytest.approx(scene.T_world_cam, abs=1e-9)


def test_ids_that_objects_json_does_not_list_are_background(view):
    entries = [{"id": 250, "mesh_path": "a.obj"}, {"id": 3, "mesh_path": "b.obj"}]
    (view.parent / "objects.json").write_text(json.dumps(entries))
    assert read_published(view).object_ids == [3, 250]


def test_without_objects_json_negative_ids_are_background(scene, view):
    np.save(view / "seg_mask.npy", scene.segmap)
    assert read_published(view).object_ids == [7, 250]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("camera.npz", {"view_matrix": np.eye(4)}, "lacks a matrix"),
        ("camera.npz", {"view_matrix": np.eye(4), "projection_matrix": np.eye(4)}, "OpenGL's"),
        ("depth.npy", np.full((120, 160), 1.5), "no OpenGL depth buffer"),
        ("depth.npy", np.full((120, 160), np.nan), "no OpenGL depth buffer"),
        ("depth.npy", np.ones((120, 160)), "no valid pixel"),
        ("seg_mask.npy", np.ones((12, 16), int), "wrong shape"),
        ("rgb.jpg", b"junk", "image cannot be read"),
        ("../objects.json", b"{", "objects.json cannot be read"),
        ("../objects.json", b'[{"name": 1}]', r"objects.json cannot be read(.|\n)*no id"),
        ("../objects.json", b"[3]", "objects.json cannot be read"),
        ("../objects.json", b'[{"id": 0}]', "background's id"),
    ],
)
def test_a_damaged_view_is_told(view, name, content, message):
    path = view / name
    if isinstance(content, dict):
        np.savez(path, **content)
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.save(path, content)
    with pytest.raises(FrameError, match=message) as caught:
        read_frame(view)
    assert_for_people(caught.value)


def test_a_depth_scale_has_no_meaning_for_a_view(view):
    with pytest.raises(FrameError, match="no depth scale"):
        read_frame(view, depth_scale=0.001)


@pytest.fixture
def real_folder(scene, tmp_path):
    """A folder of BRRP's own real scenes."""
    folder = tmp_path / "real"
    folder.mkdir()
    frame = make_frame(depth=scene.depth, K=scene.K)
    Image.fromarray(scene.rgb).save(folder / "rgb.jpg")
    np.save(folder / "xyz.npy", frame.points)
    np.save(folder / "segmentation.npy", scene.segmap)
    return folder


def test_brrps_real_scene_is_read(scene, real_folder):
    frame = read_frame(real_folder)
    assert pytest.approx(scene.K, abs=1e-3) == frame.K
    assert frame.object_ids == [-3, 7, 250]
    assert np.array_equal(frame.points[..., 2], np.where(frame.valid, scene.depth, np.nan), True)


def test_an_unknown_folder_lists_what_is_known_and_what_is_there(tmp_path):
    (tmp_path / "color.png").touch()
    with pytest.raises(FrameError, match=r"xyz\.npy(.|\n)*seg_mask\.npy(.|\n)*color\.png"):
        read_frame(tmp_path)


def test_a_frame_file_is_read_with_and_without_masks(scene, tmp_path):
    for mask in (scene.segmap, None):
        save_frame(make_frame(segmap=mask, depth=scene.depth, K=scene.K), tmp_path / "f.npz")
        assert read_frame(tmp_path / "f.npz").object_ids == ([] if mask is None else [-3, 7, 250])


K = np.array([[600.0, 0, 320], [0, 610.0, 240], [0, 0, 1]])
FOCAL = {"fx": 600, "fy": 610}
KINDS = {
    "cx": {**FOCAL, "cx": 320, "cy": 240},
    "RealSense": {**FOCAL, "ppx": 320.0, "ppy": 240.0, "coeffs": [0, 0, 0, 0, 0]},
    "x_offset": {**FOCAL, "x_offset": 320, "y_offset": 240, "img_width": 640, "img_height": 480},
    "nested K": {"K": K.tolist()},
    "flat K": {"K": K.ravel().tolist()},
    "bare list": K.tolist(),
    "ROS 1": {"header": {}, "K": K.ravel().tolist(), "D": [0] * 5, "width": 640, "height": 480},
    "ROS 2": {"k": K.ravel().tolist(), "d": [], "width": 640, "height": 480},
    "OpenCV": {"camera_matrix": {"rows": 3, "cols": 3, "data": K.ravel().tolist()}},
    "BOP": {"cam_K": K.ravel().tolist(), "depth_scale": 1.0},
    "Open3D": {"intrinsic_matrix": K.T.ravel().tolist(), "width": 640, "height": 480},
    "wrapped": {"color": {"intrinsics": {**FOCAL, "cx": 320, "cy": 240}}},
}


@pytest.mark.parametrize("kind", KINDS)
def test_intrinsics_of_every_maker_are_the_same_matrix(tmp_path, kind):
    path = tmp_path / "k.json"
    path.write_text(json.dumps(KINDS[kind]))
    camera = read_intrinsics(path)
    assert np.array_equal(camera.K, K)
    assert camera.shape in (None, (480, 640))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no JSON"),
        ("7", "no JSON object"),
        ("{}", "incomplete(.|\n)*no keys"),
        ('{"fx": 600, "fy": 600, "width": 640}', "incomplete(.|\n)*fx, fy, width"),
        ('{"fx": "600", "fy": 600, "cx": 1, "cy": 1}', "no number(.|\n)*600"),
        ('{"fx": NaN, "fy": 600, "cx": 1, "cy": 1}', "no number(.|\n)*nan"),
        ('{"K": [1, 2, 3]}', "no 3 x 3 matrix"),
        ('{"K": "diag"}', "no 3 x 3 matrix"),
        ('{"K": [[1], [2, 3]]}', "no 3 x 3 matrix"),
    ],
)
def test_wrong_intrinsics_are_told(tmp_path, text, message):
    path = tmp_path / "k.json"
    path.write_text(text)
    with pytest.raises(FrameError, match=message) as error:
        read_intrinsics(path)
    assert "fx" in error.value.fix


def test_intrinsics_that_an_editor_marked_as_utf_8_are_read(tmp_path):
    path = tmp_path / "k.json"
    path.write_text(json.dumps(KINDS["cx"]), encoding="utf-8-sig")
    assert np.array_equal(read_intrinsics(path).K, K)
    path.write_text(json.dumps(KINDS["cx"]), encoding="utf-16")
    with pytest.raises(FrameError, match=r"no JSON(.|\n)*no UTF-8 text"):
        read_intrinsics(path)


def test_lens_distortion_is_noted(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    path = tmp_path / "k.json"
    path.write_text(json.dumps({**KINDS["RealSense"], "coeffs": [0.1, 0, 0, 0, 0]}))
    read_intrinsics(path)
    assert "distortion" in caplog.text


@pytest.fixture
def images(scene, tmp_path):
    """Colour, depth, intrinsics and masks as files."""
    depth = np.where(np.isfinite(scene.depth), scene.depth, 0)
    paths = {name: tmp_path / f"{name}.png" for name in ("color", "depth", "masks")}
    Image.fromarray(scene.rgb).save(paths["color"])
    Image.fromarray((depth * 1000).round().astype(np.uint16)).save(paths["depth"])
    Image.fromarray(np.abs(scene.segmap).astype(np.uint8)).save(paths["masks"])
    paths["intrinsics"] = tmp_path / "k.json"
    paths["intrinsics"].write_text(json.dumps({"K": scene.K.tolist()}))
    return paths


def test_images_become_a_frame(scene, images):
    frame = read_images(**images)
    assert np.array_equal(frame.rgb, scene.rgb)
    assert frame.object_ids == [3, 7, 250]
    seen = np.isfinite(scene.depth)
    assert np.array_equal(frame.valid, seen)
    assert frame.points[seen][:, 2] == pytest.approx(scene.depth[seen], abs=6e-4)


def test_depth_may_be_npy_or_float_tiff(scene, images, tmp_path):
    images["depth"] = tmp_path / "depth.npy"
    np.save(images["depth"], scene.depth)
    first = read_images(**images)
    images["depth"] = tmp_path / "depth.tiff"
    Image.fromarray(scene.depth.astype(np.float32)).save(images["depth"])
    assert np.array_equal(read_images(**images).points, first.points, equal_nan=True)


def test_a_depth_scale_of_an_unknown_unit_is_asked_for(images):
    k = json.loads(images["intrinsics"].read_text())
    images["intrinsics"].write_text(json.dumps({**k, "depth_scale": 0.1}))
    with pytest.raises(FrameError, match=r"depth_scale=0\.1 (.|\n)*depth_scale=0\.0001"):
        read_images(**images)
    nearer = read_images(**images, depth_scale=0.0005)
    images["intrinsics"].write_text(json.dumps({**k, "depth_scale": 0.001}))
    ratio = nearer.points[nearer.valid] / read_images(**images).points[nearer.valid]
    assert ratio[:, 2] == pytest.approx(0.5)


def resized(path, size):
    """Write the image again at another size."""
    with Image.open(path) as image:
        image.resize(size, Image.Resampling.NEAREST).save(path)


@pytest.mark.parametrize("name", ["color", "depth", "masks"])
def test_sizes_that_disagree_are_told(images, name):
    resized(images[name], (80, 60))
    with pytest.raises(FrameError, match=r"sizes disagree(.|\n)*align depth"):
        read_images(**images)


def test_intrinsics_of_another_resolution_are_told(images):
    k = json.loads(images["intrinsics"].read_text())
    images["intrinsics"].write_text(json.dumps({**k, "width": 1280, "height": 720}))
    with pytest.raises(FrameError, match=r"160 x 120(.|\n)*1280 x 720"):
        read_images(**images)


def test_pictures_of_depth_and_of_masks_are_refused(images):
    with pytest.raises(FrameError, match="a picture, not depth"):
        read_images(**{**images, "depth": images["masks"]})
    with pytest.raises(FrameError, match="a picture, not depth"):
        read_images(**{**images, "depth": images["color"]})
    with pytest.raises(FrameError, match="colours, not ids"):
        read_images(**{**images, "masks": images["color"]})


@pytest.mark.parametrize("wide", [np.uint16, np.int32, np.float32])
def test_a_colour_image_of_wide_numbers_is_refused(images, tmp_path, wide):
    grey = np.linspace(0, 4000, 160 * 120).reshape(120, 160)
    path = tmp_path / "infrared.tiff"
    Image.fromarray(grey.astype(wide)).save(path)
    with pytest.raises(FrameError, match=r"one wide number a pixel(.|\n)*scale it to 0 to 255"):
        read_images(**{**images, "color": path})
    Image.fromarray((grey / 4000 * 255).astype(np.uint8)).save(path)
    assert read_images(**{**images, "color": path}).rgb.std() > 60


STACK = np.zeros((5, 120, 160), bool)


def other_masks(folder, kind):
    """Masks that are no one map of ids, as people have them."""
    path = folder / f"masks{kind}"
    if kind == "":
        path.mkdir()
    elif kind == ".npy":
        np.save(path, STACK)
    elif kind == ".npz":
        np.savez(path, masks=STACK)
    else:
        path.write_text('{"annotations": []}')
    return path


@pytest.mark.parametrize(
    ("kind", "found"),
    [("", "a folder"), (".npy", r"\(5, 120, 160\)"), (".npz", "npz file"), (".json", "COCO")],
)
def test_single_masks_are_to_be_joined(images, tmp_path, kind, found):
    with pytest.raises(FrameError, match=f"one grey PNG or .npy(.|\n)*{found}(.|\n)*join single"):
        read_images(**{**images, "masks": other_masks(tmp_path, kind)})


def test_the_advice_for_single_masks_gives_masks_that_are_read(images, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    masks = STACK.copy()
    masks[0, 40:60, 40:60] = masks[4, 70:90, 70:90] = True
    np.save(tmp_path / "stack.npy", masks)
    with pytest.raises(FrameError) as error:
        read_images(**{**images, "masks": tmp_path / "stack.npy"})
    advice = error.value.fix.partition(": ")[2]
    first, loop, save = advice.split("; ")
    exec(f"{first}\n{loop}\n{save}", {"np": np, "masks": masks})
    assert read_images(**{**images, "masks": tmp_path / "masks.npy"}).object_ids == [1, 5]


@pytest.mark.parametrize("name", ["color", "depth", "masks"])
def test_cut_images_are_told(images, name):
    data = images[name].read_bytes()
    images[name].write_bytes(data[: len(data) // 2])
    with pytest.raises(FrameError, match=f"image cannot be read(.|\n)*{name}"):
        read_images(**images)
