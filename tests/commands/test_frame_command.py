"""`brrp frame` as people type it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from brrp_cli.cli import main
from brrp_cli.frames.npz import load_frame

HEIGHT, WIDTH = 120, 160
K = np.array([[150.0, 0, 80], [0, 150.0, 60], [0, 0, 1]])


@pytest.fixture
def images(tmp_path):
    """A table that is tilted by 45 degrees, and two boxes on it that face the camera."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    down = (v - K[1, 2]) / K[1, 1]
    depth = 0.8 / (1 + down)
    masks = np.zeros((HEIGHT, WIDTH), np.uint8)
    for object_id, left in ((7, 30), (250, 100)):
        box = (u >= left) & (u < left + 30) & (v >= 40) & (v < 80)
        depth[box] = 0.8 / (1 + down[80, 0])
        masks[box] = object_id
    Image.fromarray(np.full((HEIGHT, WIDTH, 3), 90, np.uint8)).save(tmp_path / "c.png")
    Image.fromarray((depth * 1000).round().astype(np.uint16)).save(tmp_path / "d.png")
    Image.fromarray(masks).save(tmp_path / "m.png")
    (tmp_path / "k.json").write_text(json.dumps({"K": K.tolist()}))
    return tmp_path


def run(folder, *arguments):
    """Run `brrp frame` on the images of a folder, with more arguments."""
    files = ["--color", "c.png", "--depth", "d.png", "--intrinsics", "k.json"]
    files[1::2] = [str(folder / name) for name in files[1::2]]
    return CliRunner().invoke(main, ["frame", *files, *map(str, arguments)])


def test_images_with_masks_become_a_frame(images):
    result = run(images, "--masks", images / "m.png", "-o", images / "f.npz")
    assert result.exit_code == 0, result.output
    assert load_frame(images / "f.npz").object_ids == [7, 250]
    last = result.output.strip().splitlines()[-1]
    assert f"Wrote {images / 'f.npz'}" in last
    assert "160 x 120, 2 objects" in last
    assert f"brrp reconstruct {images / 'f.npz'}" in last


def test_segment_finds_the_objects_and_shows_them(images):
    result = run(images, "--segment", "-o", images / "f.npz")
    assert result.exit_code == 0, result.output
    assert load_frame(images / "f.npz").object_ids == [1, 2]
    with Image.open(images / "f.masks.png") as picture:
        assert picture.size == (WIDTH, HEIGHT)
    assert "f.masks.png" in result.output


def test_a_frame_file_can_be_segmented_again(images):
    run(images, "--masks", images / "m.png", "-o", images / "f.npz")
    arguments = ["frame", str(images / "f.npz"), "--segment", "-o", str(images / "g.npz")]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    assert load_frame(images / "g.npz").object_ids == [1, 2]


def test_the_depth_scale_is_used(images):
    masks = ("--masks", images / "m.png")
    run(images, *masks, "-o", images / "f.npz")
    run(images, *masks, "--depth-scale", "0.0005", "-o", images / "half.npz")
    whole, half = (load_frame(images / name).points for name in ("f.npz", "half.npz"))
    assert half == pytest.approx(whole / 2, rel=1e-5)


def test_a_folder_becomes_a_frame(images):
    run(images, "--masks", images / "m.png", "-o", images / "f.npz")
    frame = load_frame(images / "f.npz")
    folder = images / "scene"
    folder.mkdir()
    Image.fromarray(frame.rgb).save(folder / "rgb.jpg")
    np.save(folder / "xyz.npy", frame.points)
    np.save(folder / "segmentation.npy", frame.segmap)
    result = CliRunner().invoke(main, ["frame", str(folder), "-o", str(images / "g.npz")])
    assert result.exit_code == 0, result.output
    assert load_frame(images / "g.npz").object_ids == [7, 250]


def test_nothing_is_overwritten_unasked(images):
    masks = ("--masks", images / "m.png")
    (images / "f.npz").write_text("mine")
    result = run(images, *masks, "-o", images / "f.npz")
    assert result.exit_code == 1
    assert "exists already" in result.output
    assert "--overwrite" in result.output
    assert (images / "f.npz").read_text() == "mine"
    assert run(images, *masks, "--overwrite", "-o", images / "f.npz").exit_code == 0
    (images / "g.masks.png").write_text("mine")
    assert run(images, "--segment", "-o", images / "g.npz").exit_code == 1
    assert not (images / "g.npz").exists()


def test_without_masks_the_way_on_is_told(images):
    result = run(images, "-o", images / "f.npz")
    assert result.exit_code == 1
    assert "add --segment" in result.output
    assert not (images / "f.npz").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "f.npz"], "missing --color, --depth, --intrinsics"),
        (["--color", "c.png", "-o", "f.npz"], "missing --depth, --intrinsics"),
        (["folder", "--color", "c.png", "-o", "f.npz"], "either SOURCE or"),
        (["folder", "-o", "f.h5"], "must end in .npz"),
        (["folder", "--depth", "d.png", "-o", "f.npz"], "either SOURCE or"),
        (["folder"], "'-o'"),
    ],
)
def test_wrong_usage_is_exit_code_2(arguments, message):
    result = CliRunner().invoke(main, ["frame", *arguments])
    assert result.exit_code == 2
    assert message in result.output


def test_masks_and_segment_exclude_each_other(images):
    result = run(images, "--masks", images / "m.png", "--segment", "-o", images / "f.npz")
    assert result.exit_code == 2


def own_masks(images):
    """Other masks than m.png, of one object, and a frame with the latter."""
    own = np.zeros((HEIGHT, WIDTH), np.uint16)
    own[40:80, 30:60] = 3
    Image.fromarray(own).save(images / "own.png")
    assert run(images, "--masks", images / "m.png", "-o", images / "f.npz").exit_code == 0
    return own


def test_masks_of_one_s_own_replace_those_of_a_source(images):
    own = own_masks(images)
    arguments = ["frame", images / "f.npz", "--masks", images / "own.png", "-o", images / "g.npz"]
    result = CliRunner().invoke(main, list(map(str, arguments)))
    assert result.exit_code == 0, result.output
    assert "those of the source, 2 objects, are replaced" in result.stderr
    before, found = load_frame(images / "f.npz"), load_frame(images / "g.npz")
    assert np.array_equal(found.segmap, own)
    assert np.array_equal(found.points, before.points, equal_nan=True)


@pytest.mark.parametrize(
    ("masks", "says"),
    [
        (np.ones((HEIGHT // 2, WIDTH), np.uint8), "The sizes disagree"),
        (np.zeros((HEIGHT, WIDTH), np.uint8), "There is no object in the mask"),
        (np.full((HEIGHT, WIDTH), 0.5), "segmap is no map of object ids"),
    ],
)
def test_masks_that_do_not_fit_a_source_are_one_message(images, masks, says):
    own_masks(images)
    np.save(images / "wrong.npy", masks)
    arguments = ["frame", images / "f.npz", "--masks", images / "wrong.npy", "-o", images / "g.npz"]
    result = CliRunner().invoke(main, list(map(str, arguments)))
    assert result.exit_code == 1
    assert says in result.output and f"where:    {images / 'wrong.npy'}" in result.output
    assert not (images / "g.npz").exists()


def test_pictures_of_masks_that_were_replaced_do_not_stay(images):
    beside = images / "f.masks.png", images / "f.ids.png"
    for path in beside:  # of another frame, as none is replaced
        path.touch()
    own_masks(images)
    assert all(path.exists() for path in beside)
    assert run(images, "--segment", "--overwrite", "-o", images / "f.npz").exit_code == 0
    assert beside[0].stat().st_size and not beside[1].exists()
    masks = ("--masks", images / "m.png", "--overwrite", "-o", images / "f.npz")
    assert run(images, *masks).exit_code == 0
    assert not beside[0].exists()


def test_masks_that_were_named_stay_whatever_they_are_called(images):
    own_masks(images)
    (images / "own.png").rename(images / "f.ids.png")
    masks = ("--masks", images / "f.ids.png", "--overwrite", "-o", images / "f.npz")
    assert run(images, *masks).exit_code == 0
    assert load_frame(images / "f.npz").object_ids == [3] and (images / "f.ids.png").is_file()


def test_a_failure_is_one_message(images):
    np.save(images / "d.npy", np.full((HEIGHT, WIDTH), 800.0))
    arguments = ["--depth", str(images / "d.npy"), "-o", str(images / "f.npz"), "--segment"]
    result = run(images, *arguments)
    assert result.exit_code == 1
    assert result.output.startswith("Error: depth seems to be in another unit")
    assert "--depth-scale" in result.output
    assert "Traceback" not in result.output
    assert not list(images.glob("f*"))


def test_help_has_an_example():
    result = CliRunner().invoke(main, ["frame", "--help"])
    assert result.exit_code == 0
    assert "brrp frame --color c.png" in result.output
