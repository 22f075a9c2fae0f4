"""CLIP retrieval: P(c|R) from an object's crop and the stored descriptions, as in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.base import softmax
from brrp_cli.retrieval.clip_files import find_clip_files
from brrp_cli.retrieval.clip_image import clip_pixels, object_crop, stretch
from brrp_cli.retrieval.clip_text import ClipTokenizer, prompt
from brrp_cli.retrieval.clip_tower import Tower

# CLIP's learned logit scale, at which its training clips it.
LOGIT_SCALE = 100.0


class ClipRetriever:
    """P(c|R) = softmax over the prior's objects of 100 x cosine(crop, "a photo of a ...").

    folder : a published layout of CLIP ViT-B/16 as ONNX; descriptions : one short phrase for each
    object of the prior, in the order of its names. Errors: RetrievalError.
    """

    name = "clip"

    def __init__(self, folder: Path, descriptions: Sequence[str]) -> None:
        files = find_clip_files(folder)
        prompts = [prompt(description) for description in descriptions]
        tokenizer = ClipTokenizer(files.tokenizer)
        # The text tower is a quarter of a gigabyte and is not needed after this.
        text = Tower(files.text, "text")
        self._text = text.embed(tokenizer(prompts, text.length))
        self._vision = Tower(files.vision, "vision")
        self._text_path = files.text

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame, in the order of the descriptions, sum 1."""
        pixels = clip_pixels(stretch(object_crop(frame, object_id)))
        image = self._vision.embed(pixels[None])[0]
        if image.size != self._text.shape[1]:
            raise RetrievalError(
                "CLIP's text and vision models do not belong together",
                where=f"{self._text_path} and {self._vision.path}",
                expected="embeddings of one size",
                found=f"text {self._text.shape[1]}, vision {image.size}",
                fix="download both models from one repository",
            )
        return softmax(LOGIT_SCALE * self._text @ image)
