"""Which retriever is used, by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from brrp_cli.config import Config
from brrp_cli.errors import RetrievalError
from brrp_cli.retrieval.clip_files import clip_folder, need_clip_folder

if TYPE_CHECKING:
    from brrp_cli.prior.store import Prior
    from brrp_cli.retrieval.base import Retriever

RETRIEVERS = ("auto", "clip", "fitness")


def resolve_name(name: str, clip_dir: Path | None = None) -> str:
    """What `auto` means here; other names mean themselves."""
    if name != "auto":
        return name
    return "clip" if clip_folder(clip_dir) else "fitness"


def choose_retriever(
    name: str, prior: Prior, config: Config, seed: int, *, clip_dir: Path | None = None
) -> Retriever:
    """The retriever of that name. `auto` is CLIP where there is one, else fitness.

    clip_dir : folder with CLIP as ONNX; without it, the one that BRRP_CLIP_DIR names, else the one
    that `brrp fetch clip` filled. Errors: RetrievalError.
    """
    name = resolve_name(name, clip_dir)
    if name == "fitness":
        from brrp_cli.retrieval.fitness import FitnessRetriever

        return FitnessRetriever(prior, config, seed)
    if name == "clip":
        from brrp_cli.retrieval.clip import clip_retriever

        return clip_retriever(prior, need_clip_folder(clip_dir))
    raise RetrievalError("No such retriever", found=name, expected=", ".join(RETRIEVERS))
