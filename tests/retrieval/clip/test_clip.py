from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto
from small_clip import write_immich, write_model, write_tokenizer, write_xenova

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.base import top_k
from brrp_cli.retrieval.clip.image import MEAN, STD
from brrp_cli.retrieval.clip.retriever import ClipRetriever

DESCRIPTIONS = ["a blue bowl", "green bottle", "A red cracker box"]


@pytest.mark.parametrize("layout", ["xenova", "immich"])
def test_colours_find_their_prompt(
    layout: str, coloured_frame: Frame, request: pytest.FixtureRequest
) -> None:
    clip = ClipRetriever(request.getfixturevalue(layout), DESCRIPTIONS)
    for object_id, best in {7: "red", 250: "green", 3: "blue"}.items():
        probabilities = clip.probabilities(coloured_frame, object_id)
        assert 0.99 < probabilities.sum() <= 1
        assert top_k(probabilities, ["blue", "green", "red"], 1)[0][0] == best


@pytest.mark.parametrize("layout", ["xenova", "immich"])
def test_probability_is_softmax_of_100_times_the_cosine(
    layout: str, request: pytest.FixtureRequest
) -> None:
    """A crop whose pixels lie almost between two colours and white, which is what "a photo of an
    object" means to the small model: no probability is 0 or 1, and they do not sum to 1."""
    rgb = np.full((30, 30, 3), (226, 90, 210), dtype=np.uint8)
    frame = Frame(rgb, np.ones((30, 30, 3), np.float32), np.ones((30, 30), np.int64), np.eye(3))
    clip = ClipRetriever(request.getfixturevalue(layout), ["blue", "green", "red"])
    pixel = ((rgb[0, 0] / 255 - MEAN) / STD)[::-1]
    cosines = np.append(pixel, pixel.sum() / np.sqrt(3)) / np.linalg.norm(pixel)
    expected = np.exp(100 * cosines) / np.exp(100 * cosines).sum()
    assert 0.3 < expected[3] < 0.4
    assert clip.probabilities(frame, 1) == pytest.approx(expected[:3], abs=1e-3)


def test_what_no_description_fits_is_not_in_the_prior(xenova: Path, coloured_frame: Frame) -> None:
    """White is what the small model takes "an object" for."""
    rgb = coloured_frame.rgb.copy()
    rgb[coloured_frame.segmap == 7] = 255
    frame = Frame(rgb, coloured_frame.points, coloured_frame.segmap, coloured_frame.K)
    clip = ClipRetriever(xenova, DESCRIPTIONS)
    assert clip.probabilities(frame, 7).sum() < 0.01
    assert clip.probabilities(frame, 250).sum() > 0.99


def test_more_objects_than_one_batch_keep_their_order(xenova: Path, coloured_frame: Frame) -> None:
    descriptions = ["green bottle"] * 70
    descriptions[41] = "red box"
    probabilities = ClipRetriever(xenova, descriptions).probabilities(coloured_frame, 7)
    assert probabilities.argmax() == 41
    assert probabilities.shape == (70,)


def test_a_fixed_batch_larger_than_the_prior_is_filled_up(
    tmp_path: Path, coloured_frame: Frame
) -> None:
    write_xenova(tmp_path)
    write_model(
        tmp_path / "onnx/text_model.onnx",
        "text",
        name="ids",
        shape=[4, 16],
        output="text_embeds",
        dtype=TensorProto.INT32,
    )
    probabilities = ClipRetriever(tmp_path, DESCRIPTIONS * 2).probabilities(coloured_frame, 7)
    assert probabilities.shape == (6,)
    assert probabilities[[2, 5]] == pytest.approx(0.5)


def test_towers_of_two_sizes_are_refused(tmp_path: Path, coloured_frame: Frame) -> None:
    clip = ClipRetriever(write_xenova(tmp_path, size=768), DESCRIPTIONS)
    with pytest.raises(RetrievalError, match="text 512, vision 768"):
        clip.probabilities(coloured_frame, 7)


def test_swapped_towers_are_refused(tmp_path: Path) -> None:
    write_immich(tmp_path)
    (tmp_path / "visual/model.onnx").replace(tmp_path / "textual/model.onnx")
    write_model(
        tmp_path / "visual/model.onnx",
        "text",
        name="text",
        shape=[1, 77],
        output="embedding",
        dtype=TensorProto.INT32,
    )
    with pytest.raises(RetrievalError, match=r"not CLIP ViT-B/16's text model"):
        ClipRetriever(tmp_path, DESCRIPTIONS)


def test_a_vision_model_of_another_resolution_is_refused(tmp_path: Path) -> None:
    write_xenova(tmp_path)
    write_model(
        tmp_path / "onnx/vision_model.onnx",
        "vision",
        name="pixel_values",
        shape=["batch", 3, 336, 336],
        output="image_embeds",
        dtype=TensorProto.FLOAT,
    )
    with pytest.raises(RetrievalError, match="336"):
        ClipRetriever(tmp_path, DESCRIPTIONS)


@pytest.mark.parametrize("cut", [0, 1000])
def test_a_truncated_model_is_refused(tmp_path: Path, cut: int) -> None:
    write_xenova(tmp_path)
    path = tmp_path / "onnx/vision_model.onnx"
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(RetrievalError, match=r"cannot be read[\s\S]*vision_model\.onnx"):
        ClipRetriever(tmp_path, DESCRIPTIONS)


def test_nan_from_the_model_is_refused(tmp_path: Path, coloured_frame: Frame) -> None:
    clip = ClipRetriever(write_xenova(tmp_path, gain=float("nan")), DESCRIPTIONS)
    with pytest.raises(RetrievalError, match="NaN"):
        clip.probabilities(coloured_frame, 7)


def test_zeros_from_the_model_are_refused(xenova: Path) -> None:
    with pytest.raises(RetrievalError, match="zeros"):
        ClipRetriever(xenova, ["a grey mug"])


def test_an_export_without_an_embedding_is_refused(tmp_path: Path) -> None:
    write_xenova(tmp_path)
    path = tmp_path / "onnx/text_model.onnx"
    model = onnx.load(str(path))
    model.graph.output[0].name = model.graph.node[-1].output[0] = "last_hidden_state"
    model.graph.output.append(
        onnx.helper.make_tensor_value_info("colour", TensorProto.FLOAT, ["batch", 3])
    )
    onnx.save(model, str(path))
    with pytest.raises(RetrievalError, match="last_hidden_state, colour"):
        ClipRetriever(tmp_path, DESCRIPTIONS)


def test_an_embedding_for_each_token_is_refused(tmp_path: Path) -> None:
    write_xenova(tmp_path)
    path = tmp_path / "onnx/text_model.onnx"
    model = onnx.load(str(path))
    del model.graph.node[1]
    model.graph.node[1].input[0] = "words"
    model.graph.output[0].type.tensor_type.ClearField("shape")
    onnx.save(model, str(path))
    with pytest.raises(RetrievalError, match="not one embedding for each input"):
        ClipRetriever(tmp_path, DESCRIPTIONS)


def test_a_tokenizer_beyond_the_models_vocabulary_is_told(tmp_path: Path) -> None:
    """onnxruntime's own error, met while the model runs, becomes a message too."""
    write_xenova(tmp_path)
    path = tmp_path / "onnx/text_model.onnx"
    model = onnx.load(str(path))
    table = next(t for t in model.graph.initializer if t.name == "table")
    table.CopyFrom(onnx.numpy_helper.from_array(np.ones((100, 3), np.float32), "table"))
    onnx.save(model, str(path))
    write_tokenizer(tmp_path / "tokenizer.json")
    with pytest.raises(RetrievalError, match="fails when it is run"):
        ClipRetriever(tmp_path, DESCRIPTIONS)


def test_the_same_crop_gives_the_same_numbers(xenova: Path, coloured_frame: Frame) -> None:
    once, again = (
        ClipRetriever(xenova, DESCRIPTIONS).probabilities(coloured_frame, 250) for _ in range(2)
    )
    assert np.array_equal(once, again)
