"""`brrp segment` as people type it: masks made, shown, corrected."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.cli import main
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.npz import load_frame, save_frame
from brrp_cli.segmentation import edit_masks
from brrp_cli.shapes import solids


def boxes_in_a_row():
    """Boxes 4, 7 and 9 on a table, the first two side by side."""
    places = {4: -0.045, 7: 0.045, 9: 0.2}
    things = {
        i: in_camera(solids.moved(solids.box(0.08, 0.08, 0.06 + 0.01 * i), y=y), T_CAM_WORLD)
        for i, y in places.items()
    }
    return photograph(things)


@pytest.fixture
def saved(tmp_path):
    frame = boxes_in_a_row()
    save_frame(frame, tmp_path / "f.npz")
    return tmp_path / "f.npz", frame


def run(*arguments):
    return CliRunner().invoke(main, ["segment", *map(str, arguments)])


def test_masks_are_corrected_by_id(saved, tmp_path):
    path, frame = saved
    result = run(path, "--merge", "4,7", "--drop", "9", "-o", tmp_path / "g.npz")
    assert result.exit_code == 0, result.output
    fixed = load_frame(tmp_path / "g.npz")
    assert np.array_equal(fixed.segmap, np.where(np.isin(frame.segmap, (4, 7)), 4, 0))
    with Image.open(tmp_path / "g.ids.png") as ids:
        assert np.array_equal(np.asarray(ids), fixed.segmap)
    assert (tmp_path / "g.masks.png").is_file()


def test_made_masks_are_known_as_such_and_which_of_them_are_corrected(saved, tmp_path):
    path, _ = saved
    made = tmp_path / "made.npz"
    for arguments, is_made, corrected in (
        ((path, "-o", tmp_path / "kept.npz"), False, set()),
        ((path, "--again", "-o", made), True, set()),
        ((made, "-o", tmp_path / "same.npz"), True, set()),
        ((made, "--drop", "1", "-o", tmp_path / "dropped.npz"), True, set()),
        ((made, "--merge", "1,2", "-o", tmp_path / "merged.npz"), True, {1}),
        ((made, "--split", "2", "-o", tmp_path / "split.npz"), True, {2, 4}),
        ((tmp_path / "merged.npz", "--drop", "3", "-o", tmp_path / "both.npz"), True, {1}),
        ((path, "--drop", "4", "-o", tmp_path / "given.npz"), False, set()),
    ):
        result = run(*arguments)
        assert result.exit_code == 0, result.output
        found = load_frame(arguments[-1])
        assert (found.aside is not None) is is_made, arguments
        assert found.corrected == corrected, arguments


def test_one_mask_over_two_things_is_split_where_they_meet(saved, tmp_path):
    path, frame = saved
    run(path, "--merge", "4,7", "-o", tmp_path / "g.npz")
    result = run(tmp_path / "g.npz", "--split", "4", "-o", tmp_path / "h.npz")
    assert result.exit_code == 0, result.output
    found = load_frame(tmp_path / "h.npz")
    assert found.object_ids == [4, 9, 10]
    for truth in (4, 7):
        shares = [
            ((found.segmap == i) & (frame.segmap == truth)).sum() / (frame.segmap == truth).sum()
            for i in (4, 10)
        ]
        assert max(shares) > 0.9, truth
    assert " new" in result.output


def test_what_has_no_inner_boundary_is_split_by_nearness():
    frame = boxes_in_a_row()
    pieces = edit_masks.split(frame, 9, 3)
    assert np.array_equal(pieces != 0, frame.segmap != 0)
    sizes = [int((pieces == i).sum()) for i in (9, 10, 11)]
    assert min(sizes) > 0.1 * sum(sizes)


def test_masks_are_kept_unless_asked_for_again(saved, tmp_path):
    path, frame = saved
    assert run(path, "-o", tmp_path / "g.npz").exit_code == 0
    assert np.array_equal(load_frame(tmp_path / "g.npz").segmap, frame.segmap)
    assert run(path, "--again", "-o", tmp_path / "h.npz").exit_code == 0
    assert load_frame(tmp_path / "h.npz").object_ids[0] == 1


def test_a_frame_without_masks_gets_some(saved, tmp_path):
    _, frame = saved
    bare = make_frame(rgb=frame.rgb, depth=np.nan_to_num(frame.points[..., 2]), K=frame.K)
    save_frame(bare, tmp_path / "b.npz")
    result = run(tmp_path / "b.npz", "-o", tmp_path / "g.npz")
    assert result.exit_code == 0, result.output
    assert len(load_frame(tmp_path / "g.npz").object_ids) >= 2


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--merge", "4,5"], 1, "no such object"),
        (["--drop", "5"], 1, "no such object"),
        (["--drop", "5"], 1, "take ids of the picture"),
        (["--merge", "4"], 2, "two ids"),
        (["--merge", "4,4"], 2, "two ids"),
        (["--merge", "a,b"], 2, "whole numbers"),
        (["--split", "4:1"], 2, "two pieces"),
        (["--split", "x"], 2, "ID:PIECES"),
        (["--drop", "4,7,9"], 1, "no object in the mask"),
        (["--drop", "4,7,9"], 1, "found:    --drop takes all 3"),
        (["--merge", "4,7", "--drop", "7"], 2, "not in two: 7"),
        (["--all"], 2, "add --again"),
    ],
)
def test_wrong_corrections_are_told_and_write_nothing(saved, tmp_path, arguments, code, message):
    result = run(saved[0], *arguments, "-o", tmp_path / "g.npz")
    assert result.exit_code == code, result.output
    assert message in result.output
    assert not list(tmp_path.glob("g*"))


def test_masks_of_one_s_own_are_taken_and_corrected(saved, tmp_path):
    path, frame = saved
    own = np.where(frame.segmap == 9, 2, np.where(frame.segmap > 0, 1, 0))
    np.save(tmp_path / "own.npy", own)
    masks = (path, "--masks", tmp_path / "own.npy", "-o", tmp_path / "g.npz")
    result = run(*masks, "--drop", "2")
    assert result.exit_code == 0, result.output
    assert np.array_equal(load_frame(tmp_path / "g.npz").segmap, np.where(own == 1, 1, 0))
    assert "exclude each other" in run(*masks, "--again", "--overwrite").output


def test_nothing_is_overwritten_unasked(saved, tmp_path):
    path, _ = saved
    (tmp_path / "g.ids.png").write_text("mine")
    assert run(path, "-o", tmp_path / "g.npz").exit_code == 1
    assert run(path, "--drop", "9", "-o", path, "--overwrite").exit_code == 0
    assert load_frame(path).object_ids == [4, 7]


def test_numbers_of_masks_that_are_kept_are_not_silently_unused(saved, tmp_path):
    (tmp_path / "c.toml").write_text("[segmentation]\nmin_height = 0.005\n")
    options = ["--config", tmp_path / "c.toml", "-o", tmp_path / "g.npz"]
    assert "--config is of masks that are made" in run(saved[0], *options).output
    assert run(saved[0], *options, "--split", 4).exit_code == 0
    np.save(tmp_path / "own.npy", saved[1].segmap)
    own = run(saved[0], *options, "--masks", tmp_path / "own.npy", "--overwrite")
    assert own.exit_code == 2
    assert "--masks names some: leave out one of them" in own.output
    assert "--again" not in own.output, "which --masks excludes"


def test_ids_that_16_bits_do_not_hold_are_corrected_without_their_image(saved, tmp_path):
    path, frame = saved
    large = np.where(frame.segmap == 9, 70_000, frame.segmap)
    save_frame(frame.with_masks(large), path)
    (tmp_path / "g.ids.png").write_text("old")
    result = run(path, "--drop", 4, "-o", tmp_path / "g.npz", "--overwrite")
    assert result.exit_code == 0, result.output
    assert load_frame(tmp_path / "g.npz").object_ids == [7, 70_000]
    assert "16 bits do not hold all ids" in result.output
    assert not (tmp_path / "g.ids.png").exists()
