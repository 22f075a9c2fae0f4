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


def choose_retriever(
    name: str, prior: Prior, config: Config, seed: int, *, clip_dir: Path | None = None
) -> Retriever:
    """The retriever of that name. `auto` is CLIP where a folder with it is named, else fitness.

    clip_dir : folder with CLIP as ONNX; without it, the one that BRRP_CLIP_DIR names.
    """
    named = os.environ.get(CLIP_DIR_VARIABLE)
    folder = clip_dir or (Path(named) if named else None)
    if name == "auto":
        name = "clip" if folder else "fitness"
    if name == "fitness":
        from brrp_cli.retrieval.fitness import FitnessRetriever

        return FitnessRetriever(prior, config, seed)
    if name == "clip":
        if folder is None:
            raise RetrievalError(
                "CLIP needs its model",
                expected="a folder with CLIP ViT-B/16 as ONNX",
                fix=f"pass --clip-dir FOLDER or set {CLIP_DIR_VARIABLE}",
            )
        from brrp_cli.retrieval.clip import ClipRetriever

        return ClipRetriever(folder, [prior.descriptions[name] for name in prior.names])
    raise RetrievalError("No such retriever", found=name, expected=", ".join(RETRIEVERS))
