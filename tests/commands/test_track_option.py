"""`brrp reconstruct --frames --track`: frames of one stream, ids that stay."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from sphere_method import METHOD
from test_many_frames import run
from test_tracking import BLUE, GREEN, RED, START, YAW, colour_of, scene

from brrp_cli.frames.npz import load_frame, save_frame
from brrp_cli.methods.registry import METHODS

YAWS = (YAW, YAW + 0.02, YAW + 1.2)  # a little, and so far that left and right change


@pytest.fixture
def source(tmp_path, monkeypatch) -> Path:
    monkeypatch.setitem(METHODS, METHOD.name, METHOD)
    folder = tmp_path / "frames"
    folder.mkdir()
    for number, yaw in enumerate(YAWS):
        save_frame(scene(START, yaw=yaw, known=True), folder / f"f{number}.npz")
    return folder


def colours(out: Path) -> list[dict[int, tuple[int, ...]]]:
    """Id -> colour, of each frame."""
    frames = [load_frame(path / "frame.npz") for path in sorted(out.glob("*.npz"))]
    return [{i: colour_of(frame, i) for i in frame.object_ids} for frame in frames]


def test_ids_stay_and_what_is_seen_from_the_same_side_is_not_done_again(source, tmp_path):
    alone, out = tmp_path / "alone", tmp_path / "out"
    assert run(source, "--frames", ":", "-o", alone).exit_code == 0
    first, _, last = colours(alone)
    assert set(first.values()) == {RED, GREEN, BLUE} and first != last, "numbered from the left"
    result = run(source, "--frames", ":", "--track", "-o", out)
    assert result.exit_code == 0, result.output
    assert colours(out) == [first] * 3
    records = [json.loads((out / f"f{i}.npz" / "result.json").read_text()) for i in range(3)]
    spent = [[bool(each["seconds"]) for each in record["objects"]] for record in records]
    assert spent == [[True] * 3, [False] * 3, [True] * 3]
    assert json.loads((out / "frames.json").read_text())["settings"]["track"] is True


def test_a_stream_is_done_from_its_start_or_not_at_all(source, tmp_path):
    out = tmp_path / "out"
    run(source, "--frames", "0:2", "--track", "-o", out)
    again = run(source, "--frames", "0:2", "--track", "-o", out)
    assert "Wrote 0 of 2 frames, 2 were there" in again.stdout
    more = run(source, "--frames", ":", "--track", "-o", out)
    assert "2 of 3 frames were there; a stream is done from its start" in more.stderr
    assert "Wrote 3 of 3 frames" in more.stdout
    other = run(source, "--frames", ":", "-o", out)
    assert other.exit_code == 1 and "with --track before" in other.output
    assert run(source, "--frames", ":", "-o", out, "--overwrite").exit_code == 0
    other = run(source, "--frames", ":", "--track", "-o", out)
    assert other.exit_code == 1 and "without --track before" in other.output


def test_masks_that_are_made_go_along_and_are_drawn(source, tmp_path):
    for path in source.glob("*.npz"):
        save_frame(load_frame(path).without_masks(), path)
    out = tmp_path / "out"
    result = run(source, "--frames", ":", "--track", "-o", out)
    assert result.exit_code == 0, result.output
    assert all((out / f"f{i}.npz.masks.png").is_file() for i in range(3))
    first, second, last = colours(out)
    assert first == second == last and set(first.values()) == {RED, GREEN, BLUE}
    assert result.stderr.count("Masks: made on the way") == 1, "said of the first frame"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--track",), "--track is of many frames: add --frames"),
        (("--frames", ":", "--track", "--all"), "--all and --track exclude each other"),
    ],
)
def test_what_does_not_go_with_a_stream_is_a_usage_error(arguments, says, source, tmp_path):
    result = run(source, *arguments, "-o", tmp_path / "out")
    assert result.exit_code == 2 and says in result.output
    assert not (tmp_path / "out").exists()


def test_a_stream_with_a_frame_that_changed_is_done_from_its_start(source, tmp_path):
    out = tmp_path / "out"
    run(source, "--frames", "0:2", "--track", "-o", out)
    save_frame(scene(START, yaw=YAW + 0.03, known=True), source / "f1.npz")
    again = run(source, "--frames", "0:2", "--track", "-o", out)
    assert again.exit_code == 0, again.output
    assert "1 frame was reconstructed from other images or masks" in again.stderr
    assert "1 of 2 frames was there; a stream is done from its start" in again.stderr
    assert "Wrote 2 of 2 frames" in again.stdout
    again = run(source, "--frames", "0:2", "--track", "-o", out)
    assert "Wrote 0 of 2 frames, 2 were there" in again.stdout
