"""A small detector and a small segmenter of the published interfaces: all they know is colour.

The detector has one box for each of red, green and blue, around what is of that colour; a token
that is the colour's name makes the box's score high. The segmenter fills what is coloured in a box.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from tokenizers import Tokenizer, models, normalizers, pre_tokenizers

WORDS = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", ".", "red", "green", "blue", "thing"]
RGB = {"red": (255, 0, 0), "green": (0, 255, 0), "blue": (0, 0, 255)}
FLOAT, INT = TensorProto.FLOAT, TensorProto.INT64


def write_tokenizer(path: Path) -> None:
    """BERT's kind of tokenizer.json with a few words."""
    tokenizer = Tokenizer(
        models.WordPiece({word: i for i, word in enumerate(WORDS)}, unk_token="[UNK]")
    )
    tokenizer.normalizer = normalizers.BertNormalizer(lowercase=True)
    tokenizer.pre_tokenizer = pre_tokenizers.BertPreTokenizer()
    # What a file says of length and padding must not matter.
    tokenizer.enable_padding(length=9)
    tokenizer.enable_truncation(3)
    path.parent.mkdir(parents=True, exist_ok=True)
    tokenizer.save(str(path))


def save(path: Path, nodes, inputs, outputs, constants) -> None:
    graph = helper.make_graph(
        [helper.make_node(op, ins, [out], **attributes) for op, ins, out, attributes in nodes],
        "small",
        [helper.make_tensor_value_info(name, kind, shape) for name, kind, shape in inputs],
        [helper.make_tensor_value_info(name, FLOAT, shape) for name, shape in outputs],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.checker.check_model(model)
    path.parent.mkdir(parents=True, exist_ok=True)
    onnx.save(model, str(path))


def write_detector(path: Path, boxes: str = "pred_boxes") -> None:
    """Grounding DINO's interface; `boxes` names its second output."""
    last = {"axis": 2, "keepdims": 1, "select_last_index": 1}
    nodes = [
        ("ReduceMean", ["pixel_values", "channels"], "mean", {}),
        ("Sub", ["pixel_values", "mean"], "above", {}),
        ("Greater", ["above", "limit"], "hot", {}),
        ("Cast", ["hot"], "mask", {"to": FLOAT}),
        ("ReduceMax", ["mask", "down"], "columns", {"keepdims": 0}),
        ("ReduceMax", ["mask", "across"], "rows", {"keepdims": 0}),
    ]
    for name, line in (("x", "columns"), ("y", "rows")):
        nodes += [
            ("ArgMax", [line], f"{name}0i", {"axis": 2, "keepdims": 1}),
            ("ArgMax", [line], f"{name}1i", last),
            ("Cast", [f"{name}0i"], f"{name}0", {"to": FLOAT}),
            ("Cast", [f"{name}1i"], f"{name}1", {"to": FLOAT}),
            ("Add", [f"{name}1", "one"], f"{name}end", {}),
            ("Sub", [f"{name}end", f"{name}0"], f"{name}long", {}),
            ("Div", [f"{name}long", "side"], f"{name}size", {}),
            ("Add", [f"{name}end", f"{name}0"], f"{name}sum", {}),
            ("Div", [f"{name}sum", "twice"], f"{name}middle", {}),
        ]
    nodes += [
        ("Concat", ["xmiddle", "ymiddle", "xsize", "ysize"], boxes, {"axis": 2}),
        ("ReduceMax", ["columns", "last"], "present", {}),
        ("Unsqueeze", ["input_ids", "channels"], "tokens", {}),
        ("Equal", ["tokens", "names"], "named", {}),
        ("Cast", ["named"], "namedf", {"to": FLOAT}),
        ("Mul", ["namedf", "present"], "both", {}),
        ("Mul", ["both", "eight"], "high", {}),
        ("Sub", ["high", "four"], "logits", {}),
    ]
    save(
        path,
        nodes,
        [
            ("pixel_values", FLOAT, [1, 3, 800, 800]),
            ("pixel_mask", INT, [1, 800, 800]),
            ("input_ids", INT, [1, "tokens"]),
            ("token_type_ids", INT, [1, "tokens"]),
            ("attention_mask", INT, [1, "tokens"]),
        ],
        [("logits", [1, 3, "tokens"]), (boxes, [1, 3, 4])],
        {
            "channels": np.array([1]),
            "down": np.array([2]),
            "across": np.array([3]),
            "last": np.array([2]),
            "limit": np.float32(1.5),
            "one": np.float32(1),
            "side": np.float32(800),
            "twice": np.float32(1600),
            "eight": np.float32(8),
            "four": np.float32(4),
            "names": np.array([[[WORDS.index(word)] for word in RGB]]),
        },
    )


def write_segmenter(folder: Path) -> None:
    """MobileSAM's two halves: the box counts only as two points with the labels 2 and 3."""
    save(
        folder / "mobile_sam_image_encoder.onnx",
        [
            ("Transpose", ["input_image"], "planes", {"perm": [2, 0, 1]}),
            ("Unsqueeze", ["planes", "front"], "image_embeddings", {}),
        ],
        [("input_image", FLOAT, ["height", "width", 3])],
        [("image_embeddings", [1, 3, "height", "width"])],
        {"front": np.array([0])},
    )
    nodes = [
        ("Cast", ["orig_im_size"], "size", {"to": INT}),
        ("Concat", ["lead", "size"], "sizes", {"axis": 0}),
        ("Resize", ["image_embeddings", "", "", "sizes"], "image", {"mode": "nearest"}),
        ("ReduceMax", ["image", "channels"], "high", {}),
        ("ReduceMin", ["image", "channels"], "low", {}),
        ("Sub", ["high", "low"], "spread", {}),
        ("Greater", ["spread", "sixty"], "coloured", {}),
        ("ReduceMax", ["orig_im_size", "zeros"], "longer", {}),
        ("Div", ["longer", "side"], "scale", {}),
        ("Mul", ["point_coords", "scale"], "corners", {}),
        ("Reshape", ["corners", "flat"], "box", {}),
    ]
    for place, name in enumerate(("left", "top", "right", "bottom")):
        nodes.append(("Gather", ["box", f"i{place}"], name, {}))
    for axis, name, low, high in ((0, "row", "top", "bottom"), (1, "column", "left", "right")):
        nodes += [
            ("Gather", ["size", f"i{axis}"], f"{name}s", {}),
            ("Range", ["i0", f"{name}s", "i1"], f"{name}i", {}),
            ("Cast", [f"{name}i"], f"{name}f", {"to": FLOAT}),
            ("GreaterOrEqual", [f"{name}f", low], f"{name}a", {}),
            ("LessOrEqual", [f"{name}f", high], f"{name}b", {}),
            ("And", [f"{name}a", f"{name}b"], f"{name}in", {}),
        ]
    nodes += [
        ("Unsqueeze", ["rowin", "one"], "tall", {}),
        ("And", ["tall", "columnin"], "inside", {}),
        ("And", ["coloured", "inside"], "filled", {}),
        ("Equal", ["point_labels", "labels"], "right_label", {}),
        ("Cast", ["right_label"], "labelf", {"to": FLOAT}),
        ("ReduceMin", ["labelf", "one"], "is_box", {"keepdims": 0}),
        ("Cast", ["filled"], "filledf", {"to": FLOAT}),
        ("Mul", ["filledf", "is_box"], "sure", {}),
        ("Sub", ["sure", "half"], "masks", {}),
        ("Identity", ["quality"], "iou_predictions", {}),
        ("Identity", ["mask_input"], "low_res_masks", {}),
    ]
    save(
        folder / "sam_mask_decoder_single.onnx",
        nodes,
        [
            ("image_embeddings", FLOAT, [1, 3, "eh", "ew"]),
            ("point_coords", FLOAT, [1, "points", 2]),
            ("point_labels", FLOAT, [1, "points"]),
            ("mask_input", FLOAT, [1, 1, 256, 256]),
            ("has_mask_input", FLOAT, [1]),
            ("orig_im_size", FLOAT, [2]),
        ],
        [
            ("masks", [1, 1, "height", "width"]),
            ("iou_predictions", [1, 1]),
            ("low_res_masks", [1, 1, 256, 256]),
        ],
        {
            "lead": np.array([1, 3]),
            "channels": np.array([1]),
            "zeros": np.array([0]),
            "one": np.array([1]),
            "flat": np.array([4]),
            "sixty": np.float32(60),
            "side": np.float32(1024),
            "half": np.float32(0.5),
            "labels": np.array([[2, 3]], np.float32),
            "quality": np.array([[0.9]], np.float32),
            **{f"i{i}": np.array(i) for i in range(4)},
        },
    )


def write_models(folder: Path) -> Path:
    """All four files as `brrp fetch masks` lays them out."""
    write_detector(folder / "detector/onnx/model.onnx")
    write_tokenizer(folder / "detector/tokenizer.json")
    write_segmenter(folder / "segmenter")
    return folder


def write_manifest(path: Path, folder: Path) -> Path:
    """A `masks.toml` of the files in `folder`."""
    lines = ["[repositories]"]
    lines += [f'{name} = "http://nowhere.invalid/{name}"' for name in ("detector", "segmenter")]
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
        repository, _, name = file.relative_to(folder).as_posix().partition("/")
        data = file.read_bytes()
        lines += ["[[files]]", f'repository = "{repository}"', f'path = "{name}"']
        lines += [f"bytes = {len(data)}", f'sha256 = "{hashlib.sha256(data).hexdigest()}"']
    path.write_text("\n".join(lines) + "\n")
    return path
