"""Which retriever is used, by name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from brrp_cli.config import Config
from brrp_cli.errors import RetrievalError

if TYPE_CHECKING:
    from brrp_cli.prior.store import Prior
    from brrp_cli.retrieval.base import Retriever

CLIP_DIR_VARIABLE = "BRRP_CLIP_DIR"
RETRIEVERS = ("auto", "clip", "fitness")


def clip_folder(clip_dir: Path | None) -> Path | None:
    """The folder with CLIP: the one given, else the one that BRRP_CLIP_DIR names."""
    named = os.environ.get(CLIP_DIR_VARIABLE)
    return clip_dir or (Path(named) if named else None)


def need_clip_folder(clip_dir: Path | None) -> Path:
    """`clip_folder`, or a RetrievalError that says how to name one."""
    folder = clip_folder(clip_dir)
    if folder is None:
        raise RetrievalError(
            "CLIP needs its model",
            expected="a folder with CLIP ViT-B/16 as ONNX",
            fix=f"pass --clip-dir FOLDER or set {CLIP_DIR_VARIABLE}",
        )
    return folder


def resolve_name(name: str, clip_dir: Path | None = None) -> str:
    """What `auto` means here; other names mean themselves."""
    if name != "auto":
        return name
    return "clip" if clip_folder(clip_dir) else "fitness"


def choose_retriever(
    name: str, prior: Prior, config: Config, seed: int, *, clip_dir: Path | None = None
) -> Retriever:
    """The retriever of that name. `auto` is CLIP where a folder with it is named, else fitness.

    clip_dir : folder with CLIP as ONNX; without it, the one that BRRP_CLIP_DIR names.
    """
    name = resolve_name(name, clip_dir)
    if name == "fitness":
        from brrp_cli.retrieval.fitness import FitnessRetriever

        return FitnessRetriever(prior, config, seed)
    if name == "clip":
        from brrp_cli.retrieval.clip import ClipRetriever

        folder = need_clip_folder(clip_dir)
        return ClipRetriever(folder, [prior.descriptions[name] for name in prior.names])
    raise RetrievalError("No such retriever", found=name, expected=", ".join(RETRIEVERS))
