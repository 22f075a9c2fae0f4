"""Grounding DINO (Liu et al., ECCV 2024) as the hub exports it: an image and a phrase to boxes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import MaskError
from brrp_cli.learned_models import read_tokenizer
from brrp_cli.segmentation.prompted.onnx_session import Session

SIDE = 800  # the export's preprocessor stretches every image to that square
_MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
_STD = np.array([0.229, 0.224, 0.225], dtype=np.float32)
_START, _END, _DOT = "[CLS]", "[SEP]", "."
_TOKENS = 256


@dataclass(frozen=True)
class Detections:
    """Boxes (n, 4): left, top, right, bottom in pixels of the image; scores (n,), 0 to 1."""

    boxes: NDArray[np.float64]
    scores: NDArray[np.float64]


def phrases(prompt: str) -> list[str]:
    """The phrases of a prompt: parted by commas, semicolons or full stops; lower case, one space
    between words. Errors: MaskError if there is none."""
    parts = prompt.lower().replace(";", ",").replace(".", ",").split(",")
    found = [" ".join(part.split()) for part in parts if part.strip()]
    if not found:
        raise MaskError(
            "The prompt names nothing",
            expected='a phrase, such as "small object", or several: "mug, box"',
            found=repr(prompt),
        )
    return list(dict.fromkeys(found))


class Detector:
    """The model with its tokenizer."""

    def __init__(self, model: Path, tokenizer: Path) -> None:
        names = {"pixel_values", "pixel_mask", "input_ids", "token_type_ids", "attention_mask"}
        self._session = Session(model, "the detector", names, ["logits", "pred_boxes"])
        self._tokens = _Tokenizer(tokenizer)

    def __call__(self, rgb: NDArray[np.uint8], phrase: str, threshold: float) -> Detections:
        """What one phrase names in the image (H, W, 3), best first. Errors: MaskError.

        A box's score is the sigmoid of its best token.
        """
        ids = np.array([self._tokens(f"{phrase}{_DOT}")], dtype=np.int64)
        logits, boxes = self._session(
            {
                "pixel_values": pixels(rgb)[None],
                "pixel_mask": np.ones((1, SIDE, SIDE), np.int64),
                "input_ids": ids,
                "token_type_ids": np.zeros_like(ids),
                "attention_mask": np.ones_like(ids),
            }
        )
        if logits.ndim != 3 or boxes.shape != (1, logits.shape[1], 4):
            raise MaskError(
                "The detector's output is not boxes with scores",
                where=self._session.path,
                expected="logits (1, Q, T) and pred_boxes (1, Q, 4)",
                found=f"{logits.shape} and {boxes.shape}",
            )
        # Tokens beyond the phrase are -inf, which is a score of 0.
        best = np.nan_to_num(logits[0].astype(np.float64), nan=-np.inf).max(axis=1)
        scores = import_library("scipy.special").expit(best)
        height, width = rgb.shape[:2]
        middle, size = boxes[0, :, :2].astype(np.float64), boxes[0, :, 2:].astype(np.float64)
        corners = np.concatenate([middle - size / 2, middle + size / 2], axis=1)
        corners = np.clip(corners, 0, 1) * [width, height, width, height]
        order = np.argsort(-scores, kind="stable")
        order = order[scores[order] > threshold]
        return Detections(corners[order], scores[order])


def pixels(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Image (H, W, 3) to the detector's (3, 800, 800): stretched, then ImageNet's mean and
    deviation."""
    image = import_library("PIL.Image")
    square = image.fromarray(rgb).resize((SIDE, SIDE), image.Resampling.BILINEAR)
    scaled = (np.asarray(square, dtype=np.float32) / 255 - _MEAN) / _STD
    return np.ascontiguousarray(scaled.transpose(2, 0, 1))


class _Tokenizer:
    """BERT's lower-cased word pieces, from the hub's tokenizer.json."""

    def __init__(self, path: Path) -> None:
        self._tokenizer = read_tokenizer(path, partial(self._wrong, path))
        ends = [self._tokenizer.token_to_id(token) for token in (_START, _END, _DOT)]
        if None in ends:
            raise self._wrong(path, dict(zip((_START, _END, _DOT), ends, strict=True)))
        self._start, self._end, self._dot = ends

    def __call__(self, text: str) -> list[int]:
        """Start, the words, a full stop, end."""
        words = self._tokenizer.encode(text, add_special_tokens=False).ids
        if len(words) > _TOKENS - 2:
            raise MaskError(
                "The prompt is too long",
                expected=f"at most {_TOKENS - 2} word pieces",
                found=len(words),
            )
        return [self._start, *words, self._end]

    @staticmethod
    def _wrong(path: Path, found: object) -> MaskError:
        return MaskError(
            "This is not the detector's tokenizer",
            where=path,
            expected=f"a tokenizer.json of BERT, with {_START}, {_END} and {_DOT}",
            found=found,
            fix="fetch it again: brrp fetch masks",
        )
