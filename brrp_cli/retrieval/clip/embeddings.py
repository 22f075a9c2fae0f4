"""The text half of CLIP: one embedding for each prompt, computed once and kept with the prior.

They are kept in PRIOR/clip/text-XXXXXXXXXXXXXXXX.npz, named after the text model's sha256. The file
tells what it was made from; where that is not what is asked for, it is made anew. It is no part of
what the prior's manifest vouches for: deleting it costs a few seconds.

Arrays: `vectors` (n, D) float32, of length 1, in the order of the prompts; `prior` the prior's
digest; `prompts_sha256` of the prompts, one a line; `text_sha256` and `vision_sha256` of the
models, the second being that which lay beside the first.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import BrrpError, OutputError, RetrievalError
from brrp_cli.files import atomic_path, sha256_file
from brrp_cli.frames.arrays import MAX_BYTES, read_npz
from brrp_cli.retrieval.clip.manifest import known_pair, refuse_mismatch
from brrp_cli.retrieval.clip.model_files import ClipFiles, find_clip_files, find_clip_parts
from brrp_cli.retrieval.clip.text import ClipTokenizer
from brrp_cli.retrieval.clip.tower import Tower

FOLDER = "clip"
_TOLD = ("prior", "prompts_sha256", "text_sha256", "vision_sha256")
# Bytes of one embedding that is kept; CLIP ViT-B/16 has 2048.
_MAX_ROW = 2**13

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class KeepIn:
    """The prior that embeddings are kept with: its folder and its digest."""

    prior: Path
    digest: str


@dataclass(frozen=True)
class TextEmbeddings:
    """vectors : (n, D) float32, of length 1; source : the file they came from, for messages."""

    vectors: NDArray[np.float32]
    text_sha256: str
    source: Path


def text_embeddings(
    folder: Path, prompts: Sequence[str], keep: KeepIn | None = None
) -> TextEmbeddings:
    """Embeddings of the prompts by the text model of `folder`, or as they are kept.

    The text model and the tokenizer may be missing where embeddings are kept that belong to the
    vision model. Errors: RetrievalError.
    """
    parts = find_clip_parts(folder)
    if "vision" not in parts:
        find_clip_files(folder)
    vision_sha256 = sha256_file(parts["vision"])
    text_sha256 = sha256_file(parts["text"]) if "text" in parts else None
    if text_sha256 is not None:
        refuse_mismatch(text_sha256, vision_sha256, text=parts["text"], vision=parts["vision"])
    if keep is not None:
        kept = _find_kept(keep, prompts, text_sha256, vision_sha256, parts["vision"])
        if kept is not None:
            return kept
    made = _compute(find_clip_files(folder), prompts)
    if keep is not None:
        _keep(made, keep, prompts, vision_sha256)
    return made


def _compute(files: ClipFiles, prompts: Sequence[str]) -> TextEmbeddings:
    tokenizer = ClipTokenizer(files.tokenizer)
    tower = Tower(files.text, "text")
    vectors = tower.embed(tokenizer(prompts, tower.length)).astype(np.float32)
    return TextEmbeddings(vectors, sha256_file(files.text), files.text)


def _find_kept(
    keep: KeepIn,
    prompts: Sequence[str],
    text_sha256: str | None,
    vision_sha256: str,
    vision: Path,
) -> TextEmbeddings | None:
    """What is kept for these prompts, by this text model if it is there, else by one that belongs
    to the vision model. Errors: RetrievalError where all that is left belongs to another one.
    """
    folder = keep.prior / FOLDER
    if text_sha256 is not None:
        path = _path(keep, text_sha256)
        found = _read(path, keep, prompts) if path.is_file() else None
        return found[0] if found and found[0].text_sha256 == text_sha256 else None
    others = []
    for path in sorted(folder.glob("text-*.npz")):
        found = _read(path, keep, prompts)
        if found is None:
            continue
        kept, made_beside = found
        belongs = known_pair(kept.text_sha256, vision_sha256)
        if belongs or (belongs is None and made_beside == vision_sha256):
            return kept
        others.append(kept)
    if others:
        kept = others[0]
        refuse_mismatch(kept.text_sha256, vision_sha256, text=kept.source, vision=vision)
        raise RetrievalError(
            "The text embeddings kept with the prior were made beside another vision model",
            where=f"{kept.source} and {vision}",
            fix="put the text model and tokenizer that belong to the vision model beside it",
        )
    return None


def _read(path: Path, keep: KeepIn, prompts: Sequence[str]) -> tuple[TextEmbeddings, str] | None:
    """The embeddings and the sha256 of the vision model they were made beside; None where the file
    is of another prior, of other prompts, or damaged."""
    try:
        limit = max(MAX_BYTES, _MAX_ROW * len(prompts))
        arrays, _ = read_npz(path, frozenset({"vectors", *_TOLD}), limit)
        told = {name: str(arrays[name]) for name in _TOLD}
        vectors = arrays["vectors"]
    except (BrrpError, KeyError):
        log.info("The text embeddings in %s are damaged and are made anew", path)
        return None
    if (told["prior"], told["prompts_sha256"]) != (keep.digest, _sha256(prompts)):
        return None
    if vectors.dtype != np.float32 or vectors.ndim != 2 or len(vectors) != len(prompts):
        return None
    return TextEmbeddings(vectors, told["text_sha256"], path), told["vision_sha256"]


def _keep(made: TextEmbeddings, keep: KeepIn, prompts: Sequence[str], vision_sha256: str) -> None:
    """Write the file, or say why not: a prior that cannot be written can still be used."""
    told = {
        "prior": keep.digest,
        "prompts_sha256": _sha256(prompts),
        "text_sha256": made.text_sha256,
        "vision_sha256": vision_sha256,
    }
    path = _path(keep, made.text_sha256)
    try:
        with atomic_path(path) as partial, partial.open("wb") as stream:
            np.savez(stream, vectors=made.vectors, **told)  # type: ignore[arg-type]
    except OutputError as error:
        log.info("CLIP's text embeddings cannot be kept in %s: %s", path.parent, error.found)


def _path(keep: KeepIn, text_sha256: str) -> Path:
    return keep.prior / FOLDER / f"text-{text_sha256[:16]}.npz"


def _sha256(prompts: Sequence[str]) -> str:
    return hashlib.sha256("\n".join(prompts).encode()).hexdigest()
