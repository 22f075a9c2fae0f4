from pathlib import Path

import pytest

from brrp_cli.errors import RetrievalError
from brrp_cli.retrieval.clip.model_files import LAYOUTS, clip_folder, find_clip_files


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_each_layout_is_found(tmp_path: Path, layout: str) -> None:
    names = [places[0] for places in LAYOUTS[layout].values()]
    touch(tmp_path, *names)
    files = find_clip_files(tmp_path)
    assert [files.text, files.vision, files.tokenizer] == [tmp_path / name for name in names]


def test_quantised_models_are_taken_where_there_are_no_others(tmp_path: Path) -> None:
    touch(tmp_path, "onnx/text_model_quantized.onnx", "onnx/vision_model_quantized.onnx")
    touch(tmp_path, "onnx/vision_model.onnx", "tokenizer.json")
    files = find_clip_files(tmp_path)
    assert files.text.name == "text_model_quantized.onnx"
    assert files.vision.name == "vision_model.onnx"


def test_a_folder_with_one_tower_names_the_other(tmp_path: Path) -> None:
    touch(tmp_path, "visual/model.onnx", "textual/tokenizer.json")
    with pytest.raises(RetrievalError) as caught:
        find_clip_files(tmp_path)
    assert caught.value.expected == "textual/model.onnx"
    assert "visual/model.onnx" in str(caught.value.found)
    assert "immich-app" in str(caught.value.fix)


def test_a_missing_tokenizer_is_named(tmp_path: Path) -> None:
    touch(tmp_path, "onnx/text_model.onnx", "onnx/vision_model.onnx")
    with pytest.raises(RetrievalError) as caught:
        find_clip_files(tmp_path)
    assert caught.value.expected == "tokenizer.json"


def test_a_folder_of_something_else_shows_what_it_holds(tmp_path: Path) -> None:
    touch(tmp_path, "holiday.jpg")
    with pytest.raises(RetrievalError, match=r"holiday\.jpg"):
        find_clip_files(tmp_path)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(RetrievalError, match="There is no such CLIP folder"):
        find_clip_files(tmp_path / "nowhere")


def test_the_named_folder_wins_over_the_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRRP_CLIP_DIR", "/from/variable")
    assert clip_folder(Path("/named")) == Path("/named")
    assert clip_folder(None) == Path("/from/variable")
    monkeypatch.setenv("BRRP_CLIP_DIR", "")
    assert clip_folder(None) is None
