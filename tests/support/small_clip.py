"""Small CLIPs of both published interfaces: colours are all that they know of the world.

The text model sums a vector for each of the words red, green, blue, and object, which is white;
the vision model takes the mean pixel. Both map (red, green, blue) to 512 numbers by one matrix
with orthonormal rows.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from tokenizers import Regex, Tokenizer, models, normalizers, pre_tokenizers

# Ids that CLIP's vocabulary gives these words, from the published example of its tokens.
WORDS = {"photo": 1125, "of": 539, "cat": 2368}
# Green before red: as a merge of its own, "re" would otherwise split "green".
COLOURS = {"green": 40002, "red": 40001, "blue": 40003}
OBJECT = {"object": 40004}
RGB = {"red": (255, 0, 0), "green": (0, 255, 0), "blue": (0, 0, 255)}


def write_tokenizer(path: Path, start: int = 49406, end: int = 49407) -> None:
    """A byte-level BPE with CLIP's ids for bytes and special tokens, and a few whole words."""
    visible = [*range(33, 127), *range(161, 173), *range(174, 256)]
    shown = {byte: chr(byte) for byte in visible}
    hidden = [byte for byte in range(256) if byte not in shown]
    letters = [shown[b] for b in visible] + [chr(256 + i) for i in range(len(hidden))]
    vocabulary = {letter: i for i, letter in enumerate(letters)}
    vocabulary |= {letter + "</w>": 256 + i for i, letter in enumerate(letters)}
    vocabulary |= {"<|startoftext|>": start, "<|endoftext|>": end}
    merges: list[tuple[str, str]] = []
    part_id = 45000
    for word, word_id in {**WORDS, **COLOURS, **OBJECT}.items():
        left = word[0]
        for i, letter in enumerate(word[1:], start=1):
            last = i == len(word) - 1
            right = letter + "</w>" if last else letter
            if (left, right) not in merges:
                merges.append((left, right))
                vocabulary[left + right] = word_id if last else part_id
                part_id += 1
            left += right
    bpe = models.BPE(
        vocab=vocabulary, merges=merges, unk_token="<|endoftext|>", end_of_word_suffix="</w>"
    )
    tokenizer = Tokenizer(bpe)
    tokenizer.normalizer = normalizers.Sequence([normalizers.NFC(), normalizers.Lowercase()])
    tokenizer.pre_tokenizer = pre_tokenizers.Sequence(
        [
            pre_tokenizers.Split(Regex(r"\p{L}+|\p{N}|[^\s\p{L}\p{N}]+"), "removed", invert=True),
            pre_tokenizers.ByteLevel(add_prefix_space=False),
        ]
    )
    tokenizer.add_special_tokens(["<|startoftext|>", "<|endoftext|>"])
    # What a file says of length and padding must not matter.
    tokenizer.enable_padding(length=9)
    tokenizer.enable_truncation(4)
    path.parent.mkdir(parents=True, exist_ok=True)
    tokenizer.save(str(path))


def basis(size: int) -> np.ndarray:
    """(3, size) float32 with orthonormal rows."""
    q, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(size, 3)))
    return q.T.astype(np.float32)


def write_model(
    path: Path,
    kind: str,
    *,
    name: str,
    shape: list[int | str],
    output: str,
    dtype: int,
    normalised: bool = False,
    size: int = 512,
    gain: float = 1.0,
) -> None:
    """Write a text or vision model with that input and output."""
    out = "raw" if normalised else output
    constants = {"basis": basis(size) * np.float32(gain)}
    if kind == "text":
        table = np.zeros((49408, 3), dtype=np.float32)
        for column, word in enumerate(RGB):
            table[COLOURS[word], column] = 1
        table[OBJECT["object"]] = 1
        constants |= {"table": table, "axes": np.array([1])}
        nodes = [
            helper.make_node("Gather", ["table", name], ["words"]),
            helper.make_node("ReduceSum", ["words", "axes"], ["colour"], keepdims=0),
        ]
    else:
        constants |= {"axes": np.array([2, 3])}
        nodes = [helper.make_node("ReduceMean", [name, "axes"], ["colour"], keepdims=0)]
    nodes.append(helper.make_node("MatMul", ["colour", "basis"], [out]))
    if normalised:
        nodes.append(helper.make_node("LpNormalization", ["raw"], [output], axis=1, p=2))
    graph = helper.make_graph(
        nodes,
        kind,
        [helper.make_tensor_value_info(name, dtype, shape)],
        [helper.make_tensor_value_info(output, TensorProto.FLOAT, [shape[0], size])],
        [numpy_helper.from_array(value, key) for key, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.checker.check_model(model)
    path.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(model, str(path))


def write_xenova(folder: Path, suffix: str = "", *, text_gain: float = 7, **vision: float) -> Path:
    """Dynamic batch, int64, not normalised."""
    write_model(
        folder / f"onnx/text_model{suffix}.onnx",
        "text",
        name="input_ids",
        shape=["batch", "sequence"],
        output="text_embeds",
        dtype=TensorProto.INT64,
        gain=text_gain,
    )
    write_model(
        folder / f"onnx/vision_model{suffix}.onnx",
        "vision",
        name="pixel_values",
        shape=["batch", "channels", "height", "width"],
        output="image_embeds",
        dtype=TensorProto.FLOAT,
        **vision,
    )
    write_tokenizer(folder / "tokenizer.json")
    return folder


def write_manifest(path: Path, folder: Path) -> Path:
    """A `clip.toml` for the Xenova layout in `folder`, which holds both precisions."""
    lines = ['address = "http://nowhere.invalid"']
    for name, part, precision in (
        ("onnx/text_model.onnx", "text", "full"),
        ("onnx/text_model_quantized.onnx", "text", "8bit"),
        ("tokenizer.json", "tokenizer", None),
        ("onnx/vision_model.onnx", "vision", "full"),
        ("onnx/vision_model_quantized.onnx", "vision", "8bit"),
    ):
        data = (folder / name).read_bytes()
        lines += ["[[files]]", f'path = "{name}"', f'part = "{part}"', f"bytes = {len(data)}"]
        lines += [f'sha256 = "{hashlib.sha256(data).hexdigest()}"']
        lines += [f'precision = "{precision}"'] if precision else []
    path.write_text("\n".join(lines) + "\n")
    return path


def write_immich(folder: Path) -> Path:
    """A batch of one, int32 tokens of fixed length, normalised."""
    write_model(
        folder / "textual/model.onnx",
        "text",
        name="text",
        shape=[1, 77],
        output="embedding",
        dtype=TensorProto.INT32,
        normalised=True,
    )
    write_model(
        folder / "visual/model.onnx",
        "vision",
        name="image",
        shape=[1, 3, 224, 224],
        output="embedding",
        dtype=TensorProto.FLOAT,
        normalised=True,
    )
    write_tokenizer(folder / "textual/tokenizer.json")
    return folder
