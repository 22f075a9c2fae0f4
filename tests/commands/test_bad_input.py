"""The table of bad input: exit code, one message that names the file at fault, no traceback, soon.

Every case goes through a real command on files that are bad in one way.
"""

from __future__ import annotations

import json
import shlex
import struct
import time
import zlib
from dataclasses import dataclass

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from table_scene import T_CAM_WORLD, K, in_camera, photograph

from brrp_cli.cli import main
from brrp_cli.shapes import solids

# Generous: none takes a tenth of it where nothing else runs.
SECONDS = 20.0
PARTS = {
    "--color": "color.png",
    "--depth": "depth.png",
    "--intrinsics": "k.json",
    "--masks": "m.png",
}


@pytest.fixture(scope="module")
def good():
    """Arrays of two boxes on a table: colour, depth in millimetres, ids."""
    boxes = (solids.moved(solids.box(0.07, 0.07, 0.1), y=y) for y in (-0.09, 0.09))
    frame = photograph({i: in_camera(box, T_CAM_WORLD) for i, box in enumerate(boxes, start=1)})
    depth = (np.nan_to_num(frame.points[..., 2]) * 1000).round().astype(np.uint16)
    return frame.rgb, depth, frame.segmap.astype(np.uint8)


@pytest.fixture
def folder(good, tmp_path):
    rgb, depth, ids = good
    Image.fromarray(rgb).save(tmp_path / "color.png")
    Image.fromarray(depth).save(tmp_path / "depth.png")
    Image.fromarray(ids).save(tmp_path / "m.png")
    (tmp_path / "k.json").write_text(json.dumps({"K": K.tolist()}))
    return tmp_path


def run(*arguments):
    started = time.monotonic()
    result = CliRunner().invoke(main, list(map(str, arguments)))
    assert time.monotonic() - started < SECONDS
    assert "Traceback" not in result.output
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def frame(folder, *more, command="frame", **replaced):
    names = {option: replaced.get(option[2:], name) for option, name in PARTS.items()}
    given = [x for option, name in names.items() if name for x in (option, folder / name)]
    return run(command, *given, "-o", folder / ("f.npz" if command == "frame" else "out"), *more)


def one_message(result, *parts, code=1):
    """Exit code, and a message that holds `parts` and stands there once."""
    assert result.exit_code == code, result.output
    assert result.output.count("Error: ") == 1, result.output
    first = result.output.split("Error: ")[1].splitlines()[0]
    assert result.output.count(first) == 1, result.output
    for part in parts:
        assert part in result.output, result.output


@dataclass(frozen=True)
class Case:
    """What is done to one file of the good frame, and what the message holds."""

    file: str
    do: object
    says: str


def write(array):
    return lambda path: Image.fromarray(array(path) if callable(array) else array).save(path)


def depth_times(factor):
    def do(path):
        depth = np.asarray(Image.open(path)).astype(np.float64) * factor
        np.save(path.with_suffix(".npy"), (depth / 1000).astype(np.float32))

    return do


def scaled_K(factor):
    def do(path):
        larger = K.copy()
        larger[:2] *= factor
        path.write_text(json.dumps({"K": larger.tolist()}))

    return do


def huge(path):
    """A PNG whose header says 60,000 x 60,000."""
    header = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 0, 0, 0, 0)
    chunks = {b"IHDR": header, b"IDAT": zlib.compress(bytes(100)), b"IEND": b""}
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + b"".join(
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
            for kind, data in chunks.items()
        )
    )


def text(words):
    return lambda path: path.write_text(words)


def json_of(value):
    return lambda path: path.write_text(json.dumps(value))


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


CASES = {
    "no colour": Case("color.png", lambda p: p.unlink(), "No such file"),
    "no depth": Case("depth.png", lambda p: p.unlink(), "No such file"),
    "no intrinsics": Case("k.json", lambda p: p.unlink(), "No such file"),
    "no masks": Case("m.png", lambda p: p.unlink(), "No such file"),
    "colour cut": Case("color.png", cut, "cannot be read"),
    "depth cut": Case("depth.png", cut, "cannot be read"),
    "depth empty file": Case("depth.png", text(""), "cannot be read"),
    "depth is text": Case("depth.png", text("hello"), "cannot be read"),
    "depth of 8 bit": Case("depth.png", write(np.full((240, 320), 90, np.uint8)), "not depth"),
    "depth in colour": Case("depth.png", write(np.zeros((240, 320, 3), np.uint8)), "not depth"),
    "depth of another size": Case(
        "depth.png", write(np.full((120, 160), 800, np.uint16)), "sizes disagree"
    ),
    "depth all 0": Case(
        "depth.png", write(np.zeros((240, 320), np.uint16)), "depth has no valid pixel"
    ),
    "colour larger than the limit": Case("color.png", huge, "larger than the limit"),
    "depth larger than the limit": Case(
        "depth.png", write(np.zeros((4097, 4097), np.uint16)), "larger than the limit"
    ),
    "intrinsics broken": Case("k.json", text('{"K": [[1,'), "where:    "),
    "intrinsics negative": Case("k.json", scaled_K(-1), "focal length"),
    "intrinsics NaN": Case("k.json", text('{"fx": NaN, "fy": 1, "cx": 1, "cy": 1}'), "no number"),
    "intrinsics doubled": Case("k.json", scaled_K(2), "of a larger image"),
    "intrinsics times 1.5": Case("k.json", scaled_K(1.5), "divide fx, fy, cx and cy by 1.5"),
    "intrinsics normalised": Case("k.json", scaled_K(1 / 320), "not in pixels"),
    "intrinsics of another camera_info": Case("k.json", json_of({"a": 1}), "where:    "),
    "masks empty": Case("m.png", write(np.zeros((240, 320), np.uint8)), "no object in the mask"),
    "masks in colour": Case(
        "m.png", write(np.zeros((240, 320, 3), np.uint8)), "has colours, not ids"
    ),
    "masks of another size": Case("m.png", write(np.ones((10, 10), np.uint8)), "sizes disagree"),
    "masks are depth": Case(
        "m.png",
        write(np.arange(240 * 320).reshape(240, 320).astype(np.uint16)),
        "too many objects",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_bad_file_is_named(name, folder):
    case = CASES[name]
    case.do(folder / case.file)
    result = frame(folder)
    one_message(result, case.says, f"where:    {folder / case.file}")
    assert "damaged" not in result.output or "read" in case.says
    assert not (folder / "f.npz").exists()


@pytest.mark.parametrize("factor", [10, 100, 1000, 0.1, 0.01, 0.001])
def test_a_wrong_unit_is_suspected(factor, folder, caplog):
    depth_times(factor)(folder / "depth.png")
    result = frame(folder, depth="depth.npy")
    told = result.output + caplog.text
    assert "unit" in told and "--depth-scale" in told
    assert told.count("unit, and say" if result.exit_code == 0 else "in another unit") == 1
    assert result.exit_code == (0 if factor in (10, 0.1) else 1), told


def test_the_right_unit_is_not_suspected(folder, caplog):
    result = frame(folder)
    assert result.exit_code == 0 and "suspect" not in result.output + caplog.text


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.8])
def test_depth_that_is_no_depth(bad, folder):
    np.save(folder / "depth.npy", np.full((240, 320), bad, np.float32))
    one_message(frame(folder, depth="depth.npy"), "depth.npy", "depth")


@pytest.mark.parametrize(
    ("pixels", "random"), [(5, False), (400, False), (5, True), (400, True), (4000, True)]
)
def test_sparse_depth_is_one_message(pixels, random, folder, good):
    rng = np.random.default_rng(0)
    depth = rng.integers(200, 3000, good[1].shape) if random else good[1]
    kept = rng.permutation(depth.size).reshape(depth.shape) < pixels
    Image.fromarray(np.where(kept, depth, 0).astype(np.uint16)).save(folder / "depth.png")
    one_message(frame(folder, "--segment", masks=None), "Too little depth", "pixels have depth")


def test_a_twentieth_of_the_depth_is_enough_for_masks(folder, good):
    kept = np.random.default_rng(0).permutation(good[1].size).reshape(good[1].shape) < 4000
    Image.fromarray(np.where(kept, good[1], 0).astype(np.uint16)).save(folder / "depth.png")
    result = frame(folder, "--segment", masks=None)
    assert result.exit_code == 0 and "2 objects" in result.output


def test_sparse_depth_below_given_masks_is_a_status(folder, good):
    kept = np.random.default_rng(0).permutation(good[1].size).reshape(good[1].shape) < 5
    Image.fromarray(np.where(kept, good[1], 0).astype(np.uint16)).save(folder / "depth.png")
    result = frame(folder, "--method", "vprism", command="reconstruct")
    assert result.exit_code == 3, result.output
    assert result.output.count("too_few_points") == 2


def test_depth_of_one_value_is_one_message(folder):
    Image.fromarray(np.full((240, 320), 800, np.uint16)).save(folder / "depth.png")
    one_message(frame(folder, "--segment", masks=None), "Nothing stands on the table")


@pytest.mark.parametrize(
    ("what", "says"),
    [("missing", "where:"), ("file", "where:"), ("empty", "where:"), ("foreign", "where:")],
)
def test_a_prior_that_is_none(what, says, folder):
    prior = folder / "prior"
    if what == "file":
        prior.write_text("hello")
    elif what != "missing":
        prior.mkdir()
        if what == "foreign":
            (prior / "manifest.json").write_text('{"name": "a web app"}')
    result = frame(folder, "--prior", prior, command="reconstruct")
    one_message(result, says, str(prior))
    assert not (folder / "out").exists()


@pytest.mark.parametrize("name", ["missing", "empty", "foreign", "cut.npz", "no arrays.npz"])
def test_a_source_that_is_none(name, folder):
    source = folder / name
    if name == "empty":
        source.mkdir()
    elif name == "foreign":
        source.mkdir()
        (source / "thesis.tex").touch()
    elif name == "cut.npz":
        np.savez(source, depth=np.ones((50, 50)), K=K)
        cut(source)
    elif name == "no arrays.npz":
        np.savez(source)
    one_message(run("reconstruct", source, "--method", "vprism"), str(source))


def test_output_that_cannot_be_there(folder):
    (folder / "file").write_text("")
    arguments = ["--method", "vprism", "--overwrite"]
    blocked = frame(folder, *arguments, "-o", folder / "file" / "out", command="reconstruct")
    one_message(blocked, "Cannot write")
    (folder / "out").mkdir()
    (folder / "out" / "thesis.tex").touch()
    one_message(frame(folder, *arguments, command="reconstruct"), "would delete them")
    assert (folder / "out" / "thesis.tex").exists()


@pytest.mark.parametrize("command", ["view", "export"])
def test_results_that_are_none(command, folder):
    one_message(run(command, folder), "where:")
    one_message(run(command, folder / "not there"), "not there")


@pytest.mark.parametrize("value", ["-1", "1.5", "one"])
@pytest.mark.parametrize("command", ["reconstruct", "frame", "demo"])
def test_a_seed_that_is_none(command, value, folder):
    result = run(command, "--seed", value, "-o", folder / "f.npz")
    assert result.exit_code == 2 and "--seed" in result.output


def test_suggested_commands_work_with_odd_names(folder):
    odd = folder / "my frame's & more.npz"
    result = frame(folder, "-o", odd)
    assert result.exit_code == 0, result.output
    suggested = result.output.split("Next: ")[1].strip()
    assert shlex.split(suggested) == ["brrp", "reconstruct", str(odd)]
