"""Masks by a prompt, with small models of the published interfaces, through the commands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from small_grounded_sam import RGB, write_detector, write_manifest, write_models
from table_scene import T_CAM_WORLD, in_camera, photograph

from brrp_cli.cli import main
from brrp_cli.config.segmentation import SegmentConfig
from brrp_cli.errors import FrameError, MaskError
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import load_frame, save_frame
from brrp_cli.segmentation.prompted.detector import Detector, phrases
from brrp_cli.segmentation.prompted.mask_files import find_mask_files
from brrp_cli.segmentation.prompted.segment_by_prompt import PromptSegmenter, layered
from brrp_cli.shapes import solids


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_models(tmp_path_factory.mktemp("models"))


@pytest.fixture(scope="module")
def coloured() -> Frame:
    """Objects 1 (red), 2 (green) and 3 (blue) on a grey table, without masks but for the truth."""
    places = {1: (0.0, -0.12), 2: (0.0, 0.0), 3: (0.0, 0.12)}
    things = {
        i: in_camera(solids.moved(solids.box(0.06, 0.06, 0.09), x=x, y=y), T_CAM_WORLD)
        for i, (x, y) in places.items()
    }
    frame = photograph(things)
    rgb = frame.rgb.copy()
    for i, colour in enumerate(RGB.values(), start=1):
        rgb[frame.segmap == i] = colour
    return replace(frame, rgb=rgb)


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    return float((first & second).sum() / (first | second).sum())


def test_each_phrase_finds_what_it_names(models: Path, coloured: Frame) -> None:
    again = PromptSegmenter(models)
    blue = again(coloured, "Blue  thing.")
    assert np.unique(blue).tolist() == [0, 1]
    assert overlap(blue == 1, coloured.segmap == 3) > 0.9
    two = again(coloured, "blue; red")
    assert np.unique(two).tolist() == [0, 1, 2]
    columns = [np.nonzero(two == i)[1].mean() for i in (1, 2)]
    assert columns[0] < columns[1]
    best = [max(overlap(two == i, coloured.segmap == t) for i in (1, 2)) for t in (1, 3)]
    assert min(best) > 0.9


def test_what_is_not_in_the_image_is_told(models: Path, coloured: Frame) -> None:
    grey = replace(coloured, rgb=np.full_like(coloured.rgb, 128))
    with pytest.raises(FrameError, match=r"found nothing(.|\n)*--segment"):
        PromptSegmenter(models)(grey, "red")


def test_boxes_are_in_the_pixels_of_the_image(models: Path, coloured: Frame) -> None:
    files = find_mask_files(models)
    found = Detector(files.detector, files.tokenizer)(coloured.rgb, "green", 0.3)
    rows, columns = np.nonzero(coloured.segmap == 2)
    truth = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert found.boxes.shape == (1, 4)
    assert found.boxes[0] == pytest.approx(truth, abs=2)
    assert found.scores[0] == pytest.approx(1 / (1 + np.exp(-4)), abs=1e-6)


def test_masks_are_filtered_by_depth(coloured: Frame) -> None:
    config, seed = SegmentConfig(), 0
    table = (coloured.segmap == 0) & coloured.valid
    table[:, 160:] = False
    with pytest.raises(FrameError, match="after the depth filters"):
        layered([table], coloured, seed, config)
    speck = coloured.segmap == 1
    speck[5:7, 5:7] = True
    cleaned = layered([speck], coloured, seed, config)
    assert not cleaned[5:7, 5:7].any()
    assert overlap(cleaned == 1, coloured.segmap == 1) > 0.9
    twice = layered([coloured.segmap == 1, coloured.segmap == 1], coloured, seed, config)
    assert np.unique(twice).tolist() == [0, 1]


def test_a_smaller_mask_lies_in_front(coloured: Frame) -> None:
    whole = np.isin(coloured.segmap, (1, 2))
    layers = layered([coloured.segmap == 2, whole], coloured, 0, SegmentConfig())
    inner = layers[coloured.segmap == 2]
    assert len(np.unique(inner[inner > 0])) == 1
    assert set(np.unique(layers[coloured.segmap == 1])) - {0} == {1, 2} - set(np.unique(inner))


@pytest.mark.parametrize(
    ("prompt", "found"),
    [
        ("a Mug.", ["a mug"]),
        ("mug, box;mug", ["mug", "box"]),
        ("a mug. a  box.", ["a mug", "a box"]),
    ],
)
def test_a_prompt_is_one_or_more_phrases(prompt: str, found: list[str]) -> None:
    assert phrases(prompt) == found


def test_an_empty_prompt_is_refused() -> None:
    with pytest.raises(MaskError, match="names nothing"):
        phrases(" . ,")


def test_missing_and_wrong_models_are_told(models: Path, tmp_path: Path) -> None:
    with pytest.raises(MaskError, match=r"brrp fetch masks"):
        find_mask_files(tmp_path)
    files = find_mask_files(models)
    with pytest.raises(MaskError, match=r"not the detector(.|\n)*pixel_values"):
        Detector(files.encoder, files.tokenizer)
    write_detector(tmp_path / "other.onnx", boxes="boxes")
    with pytest.raises(MaskError, match=r"not the detector(.|\n)*outputs boxes|logits, boxes"):
        Detector(tmp_path / "other.onnx", files.tokenizer)
    (tmp_path / "junk.onnx").write_bytes(b"junk")
    with pytest.raises(MaskError, match="cannot be read"):
        Detector(tmp_path / "junk.onnx", files.tokenizer)
    (tmp_path / "tokenizer.json").write_text("{}")
    with pytest.raises(MaskError, match="tokenizer"):
        Detector(files.detector, tmp_path / "tokenizer.json")


def run(*arguments: object):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_what_is_fetched_is_what_a_prompt_uses(
    models: Path, coloured: Frame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = write_manifest(tmp_path / "masks.toml", models)
    monkeypatch.setattr("brrp_cli.segmentation.prompted.mask_files.MANIFEST", manifest)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("BRRP_MASKS_DIR", raising=False)
    save_frame(replace(coloured, segmap=np.zeros_like(coloured.segmap)), tmp_path / "f.npz")
    arguments = ("segment", tmp_path / "f.npz", "--prompt", "red, green", "-o", tmp_path / "g.npz")
    missing = run(*arguments)
    assert missing.exit_code == 1
    assert "brrp fetch masks" in missing.output
    fetched = run("fetch", "masks", "--from", models)
    assert fetched.exit_code == 0, fetched.output
    assert "4 files fetched, 0 there already" in fetched.output
    assert "0 files fetched, 4 there already" in run("fetch", "masks", "--from", models).output
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    assert load_frame(tmp_path / "g.npz").object_ids == [1, 2]


def test_precisions_and_folders_belong_to_what_is_fetched() -> None:
    assert run("fetch", "masks", "--precision", "8bit").exit_code == 2
    assert run("fetch", "clip", "--precision", "4bit").exit_code == 2
    assert run("fetch", "clip", "--masks-dir", "x").exit_code == 2
    assert run("fetch", "masks", "--clip-dir", "x").exit_code == 2
