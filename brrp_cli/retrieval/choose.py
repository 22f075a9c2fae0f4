"""Which retriever is used, by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from brrp_cli.config import Config
from brrp_cli.errors import RetrievalError
from brrp_cli.retrieval.clip.model_files import clip_folder, need_clip_folder

if TYPE_CHECKING:
    from brrp_cli.prior.store import Prior
    from brrp_cli.retrieval.base import Retriever

# In place of a name, a file with probabilities may stand.
RETRIEVERS = ("auto", "clip", "appearance", "both", "uniform")
USE_CLIP = ("clip", "both")


def resolve_name(name: str, clip_dir: Path | None = None) -> str:
    """What `auto` means here; other names mean themselves."""
    if name != "auto":
        return name
    return "clip" if clip_folder(clip_dir) else "appearance"


def choose_retriever(
    name: str, prior: Prior, config: Config, seed: int, *, clip_dir: Path | None = None
) -> Retriever:
    """The retriever of that name, or the one that reads the file of that name.

    `auto` is CLIP where there is one, else appearance.

    clip_dir : folder with CLIP as ONNX; without it, the one that BRRP_CLIP_DIR names, else the one
    that `brrp fetch clip` filled. Errors: RetrievalError.
    """
    name = resolve_name(name, clip_dir)
    if name == "both":
        from brrp_cli.retrieval.combined import BothRetriever

        return BothRetriever(
            _one("clip", prior, config, seed, clip_dir),
            _one("appearance", prior, config, seed, clip_dir),
        )
    return _one(name, prior, config, seed, clip_dir)


def _one(name: str, prior: Prior, config: Config, seed: int, clip_dir: Path | None) -> Retriever:
    if name == "appearance":
        from brrp_cli.retrieval.appearance import AppearanceRetriever

        return AppearanceRetriever(prior, config, seed)
    if name == "uniform":
        from brrp_cli.retrieval.given import UniformRetriever

        return UniformRetriever(prior.names)
    if name == "clip":
        from brrp_cli.retrieval.clip.retriever import clip_retriever

        return clip_retriever(prior, need_clip_folder(clip_dir))
    if Path(name).is_file():
        from brrp_cli.retrieval.table import TableRetriever

        return TableRetriever(Path(name), prior.names)
    raise RetrievalError(
        "No such retriever", found=name, expected=f"{', '.join(RETRIEVERS)}, or a file"
    )
