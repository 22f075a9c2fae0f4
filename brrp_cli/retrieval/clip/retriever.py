"""CLIP retrieval: P(c|R) from an object's crop and the stored descriptions, as in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.clip.embeddings import KeepIn, TextEmbeddings, text_embeddings
from brrp_cli.retrieval.clip.image import clip_pixels, object_crop, stretch
from brrp_cli.retrieval.clip.model_files import find_clip_parts
from brrp_cli.retrieval.clip.text import prompt
from brrp_cli.retrieval.clip.tower import Tower

if TYPE_CHECKING:
    from brrp_cli.prior.store import Prior

# CLIP's learned logit scale, at which its training clips it.
LOGIT_SCALE = 100.0
# What an object is that no description fits: its share of the softmax is P(not in the prior). One
# phrase, at the same scale and with no weight of its own: nothing was fitted, as no weights of CLIP
# were at hand to fit with. The paper has no such phrase; leaving it out changes no ratio.
BACKGROUND = "an object"


class ClipRetriever:
    """P(c|R) = softmax of 100 x cosine(crop, "a photo of a ...") over the prior's objects and one
    phrase that fits anything, whose share is left out.

    folder : a published layout of CLIP ViT-B/16 as ONNX; descriptions : one short phrase for each
    object of the prior, in the order of its names; keep : prior that the text embeddings are kept
    with, so that the vision model suffices the next time. Errors: RetrievalError.
    """

    name = "clip"

    def __init__(
        self, folder: Path, descriptions: Sequence[str], keep: KeepIn | None = None
    ) -> None:
        self._text = embed_descriptions(folder, descriptions, keep)
        self._vision = Tower(find_clip_parts(folder)["vision"], "vision")

    def probabilities(self, frame: Frame, object_id: int) -> NDArray[np.float64]:
        """P(c|R) (n,) for one object of the frame, in the order of the descriptions.

        They sum to 1 - P(not in the prior).
        """
        pixels = clip_pixels(stretch(object_crop(frame, object_id)))
        image = self._vision.embed(pixels[None])[0]
        vectors = self._text.vectors
        if image.size != vectors.shape[1]:
            raise RetrievalError(
                "CLIP's text and vision models do not belong together",
                where=f"{self._text.source} and {self._vision.path}",
                expected="embeddings of one size",
                found=f"text {vectors.shape[1]}, vision {image.size}",
                fix="take both models from one repository: brrp fetch clip",
            )
        # In single precision, as they are stored: a copy of 50,000 in double would be 0.2 GB.
        cosine = vectors @ image.astype(np.float32)
        share = import_library("scipy.special").softmax((LOGIT_SCALE * cosine).astype(np.float64))
        return np.asarray(share[:-1])


def embed_descriptions(
    folder: Path, descriptions: Sequence[str], keep: KeepIn | None = None
) -> TextEmbeddings:
    """Embeddings (n + 1, D) of the prompts for the descriptions, the background's last."""
    return text_embeddings(folder, [prompt(d) for d in [*descriptions, BACKGROUND]], keep)


def clip_retriever(prior: Prior, folder: Path) -> ClipRetriever:
    """CLIP over the objects of a prior, with which the text embeddings are kept."""
    return ClipRetriever(folder, prior.phrases, KeepIn(prior.path, prior.digest))


def keep_descriptions(prior: Prior, folder: Path) -> None:
    """Keep the embeddings of a prior's descriptions with it, unless they are there already."""
    embed_descriptions(folder, prior.phrases, KeepIn(prior.path, prior.digest))
