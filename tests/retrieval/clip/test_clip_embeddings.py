"""Text embeddings kept with a prior: used where they are right, made anew where they are not."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

import numpy as np
import pytest
from small_clip import write_xenova

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.clip.embeddings import KeepIn, text_embeddings
from brrp_cli.retrieval.clip.retriever import ClipRetriever

DESCRIPTIONS = ["a blue bowl", "green bottle", "A red cracker box"]
DIGEST = "d" * 64


@pytest.fixture
def prior(tmp_path: Path) -> Path:
    (tmp_path / "prior").mkdir()
    return tmp_path / "prior"


@pytest.fixture
def clip(xenova: Path, tmp_path: Path) -> Path:
    """A CLIP to take apart."""
    return Path(shutil.copytree(xenova, tmp_path / "clip"))


def answer(
    clip: Path, prior: Path, frame: Frame, *, descriptions=DESCRIPTIONS, digest=DIGEST
) -> np.ndarray:
    return ClipRetriever(clip, descriptions, KeepIn(prior, digest)).probabilities(frame, 7)


def kept(prior: Path) -> Path:
    (path,) = (prior / "clip").iterdir()
    return path


def leave_vision_only(clip: Path) -> None:
    (clip / "onnx/text_model.onnx").unlink()
    (clip / "tokenizer.json").unlink()


def test_the_vision_model_is_enough_once_embeddings_are_kept(
    clip: Path, prior: Path, coloured_frame: Frame
) -> None:
    computed = ClipRetriever(clip, DESCRIPTIONS).probabilities(coloured_frame, 7)
    first = answer(clip, prior, coloured_frame)
    before = kept(prior).read_bytes()
    leave_vision_only(clip)
    second = answer(clip, prior, coloured_frame)
    assert np.array_equal(computed, first) and np.array_equal(first, second)
    assert kept(prior).read_bytes() == before


def test_the_same_prompts_give_the_same_file(
    clip: Path, prior: Path, coloured_frame: Frame
) -> None:
    answer(clip, prior, coloured_frame)
    before = kept(prior).read_bytes()
    kept(prior).unlink()
    answer(clip, prior, coloured_frame)
    assert kept(prior).read_bytes() == before


def test_another_prior_or_other_prompts_are_computed_anew(
    clip: Path, prior: Path, coloured_frame: Frame
) -> None:
    answer(clip, prior, coloured_frame)
    swapped = answer(clip, prior, coloured_frame, descriptions=DESCRIPTIONS[::-1])
    assert swapped.argmax() == 0
    before = kept(prior).read_bytes()
    answer(clip, prior, coloured_frame, descriptions=DESCRIPTIONS[::-1], digest="e" * 64)
    assert kept(prior).read_bytes() != before


@pytest.mark.parametrize(
    "change", [{"digest": "e" * 64}, {"descriptions": ["red", "green", "blue"]}]
)
def test_stale_embeddings_are_not_used_where_the_text_model_is_missing(
    clip: Path, prior: Path, coloured_frame: Frame, change: dict
) -> None:
    answer(clip, prior, coloured_frame)
    leave_vision_only(clip)
    with pytest.raises(RetrievalError, match=r"not complete[\s\S]*text_model\.onnx"):
        answer(clip, prior, coloured_frame, **change)


def test_another_text_model_is_asked_anew(clip: Path, prior: Path, coloured_frame: Frame) -> None:
    answer(clip, prior, coloured_frame)
    (clip / "onnx/text_model.onnx").write_bytes(b"no model")
    with pytest.raises(RetrievalError, match="text model cannot be read"):
        answer(clip, prior, coloured_frame)


def test_each_text_model_has_its_own_file(
    published: Path, manifest: Path, tmp_path: Path, prior: Path, coloured_frame: Frame
) -> None:
    clip = Path(shutil.copytree(published, tmp_path / "clip"))
    full = answer(clip, prior, coloured_frame)
    (clip / "onnx/text_model.onnx").unlink()
    assert answer(clip, prior, coloured_frame) == pytest.approx(full)
    assert len(list((prior / "clip").iterdir())) == 2


def test_a_damaged_file_is_never_used(clip: Path, prior: Path) -> None:
    """Where a flipped bit or a cut changes what is read, the embeddings are computed anew."""
    prompts, keep = ["a photo of a red box", "a photo of a blue cup"], KeepIn(prior, DIGEST)
    right = text_embeddings(clip, prompts, keep)
    path = kept(prior)
    whole = path.read_bytes()
    places = np.random.default_rng(0).integers(8 * len(whole), size=60)
    for place in places:
        data = bytearray(whole)
        data[place // 8] ^= 1 << (place % 8)
        path.write_bytes(data)
        assert np.array_equal(text_embeddings(clip, prompts, keep).vectors, right.vectors)
    for length in (0, 10, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        assert np.array_equal(text_embeddings(clip, prompts, keep).vectors, right.vectors)
        assert path.read_bytes() == whole


def test_a_prior_that_cannot_be_written_is_used_with_a_note(
    clip: Path, prior: Path, coloured_frame: Frame, caplog: pytest.LogCaptureFixture
) -> None:
    (prior / "clip").write_text("a file where the folder would be")
    caplog.set_level(logging.INFO)
    found = answer(clip, prior, coloured_frame)
    assert found.argmax() == 2
    assert "cannot be kept" in caplog.text


def test_kept_embeddings_of_another_training_are_refused(
    clip: Path, prior: Path, coloured_frame: Frame, published: Path, manifest: Path
) -> None:
    """The text embeddings are of an unknown model; the vision model is a published one."""
    write_xenova(clip, text_gain=3, gain=3.0)
    answer(clip, prior, coloured_frame)
    leave_vision_only(clip)
    shutil.copy(published / "onnx/vision_model.onnx", clip / "onnx/vision_model.onnx")
    with pytest.raises(RetrievalError, match=r"do not belong together[\s\S]*clip/text-") as caught:
        answer(clip, prior, coloured_frame)
    assert "text model with the sha256" in str(caught.value.expected)


def test_a_text_model_of_another_training_is_refused(
    clip: Path, prior: Path, coloured_frame: Frame, published: Path, manifest: Path
) -> None:
    """Both give 512 numbers; the sums tell them apart, before any of them is run."""
    write_xenova(clip, text_gain=3, gain=3.0)
    shutil.copy(published / "onnx/vision_model.onnx", clip / "onnx/vision_model.onnx")
    with pytest.raises(RetrievalError, match="do not belong together"):
        ClipRetriever(clip, DESCRIPTIONS)
    assert not (prior / "clip").exists()


def test_kept_embeddings_of_unknown_models_stay_with_their_vision_model(
    clip: Path, prior: Path, coloured_frame: Frame
) -> None:
    answer(clip, prior, coloured_frame)
    leave_vision_only(clip)
    with (clip / "onnx/vision_model.onnx").open("ab") as stream:
        stream.write(b"\0")
    with pytest.raises(RetrievalError, match="beside another vision model"):
        answer(clip, prior, coloured_frame)


def test_8_bit_vision_goes_with_text_of_full_precision(
    published: Path, manifest: Path, tmp_path: Path, prior: Path, coloured_frame: Frame
) -> None:
    clip = Path(shutil.copytree(published, tmp_path / "clip"))
    answer(clip, prior, coloured_frame)
    leave_vision_only(clip)
    for name in ("text_model_quantized.onnx", "vision_model.onnx"):
        (clip / "onnx" / name).unlink()
    assert answer(clip, prior, coloured_frame).argmax() == 2
