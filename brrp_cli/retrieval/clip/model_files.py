"""Where the files of CLIP ViT-B/16 lie: a folder in a published layout, named or fetched."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

from brrp_cli.errors import RetrievalError

CLIP_DIR_VARIABLE = "BRRP_CLIP_DIR"


@dataclass(frozen=True)
class ClipFiles:
    """The three files that CLIP is made of."""

    text: Path
    vision: Path
    tokenizer: Path


# For each file of each layout: where it may lie, the best first (full precision before 8 bit).
LAYOUTS: dict[str, dict[str, tuple[str, ...]]] = {
    "Xenova/clip-vit-base-patch16": {
        "text": ("onnx/text_model.onnx", "onnx/text_model_quantized.onnx"),
        "vision": ("onnx/vision_model.onnx", "onnx/vision_model_quantized.onnx"),
        "tokenizer": ("tokenizer.json",),
    },
    "immich-app/ViT-B-16__openai": {
        "text": ("textual/model.onnx",),
        "vision": ("visual/model.onnx",),
        "tokenizer": ("textual/tokenizer.json",),
    },
}


def clip_cache() -> Path:
    """Where `brrp fetch clip` puts CLIP when nobody says."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("brrp")) / "clip"


def named_clip_folder(named: Path | None) -> Path | None:
    """The folder that was named, else the one in BRRP_CLIP_DIR, else None."""
    variable = os.environ.get(CLIP_DIR_VARIABLE)
    return named or (Path(variable) if variable else None)


def clip_folder(named: Path | None) -> Path | None:
    """The folder with CLIP: the one named, else that of the user's cache if CLIP was fetched into
    it, else None: there is no CLIP."""
    # The vision model is fetched last, and no file has its name before it has been checked.
    fetched = clip_cache() if "vision" in find_clip_parts(clip_cache()) else None
    return named_clip_folder(named) or fetched


def need_clip_folder(named: Path | None) -> Path:
    """`clip_folder`, or a RetrievalError that says how to come by one."""
    folder = clip_folder(named)
    if folder is None:
        raise RetrievalError(
            "CLIP needs its model",
            expected="a folder with CLIP ViT-B/16 as ONNX",
            fix="fetch it once: brrp fetch clip; or name a folder that has it with --clip-dir or "
            f"{CLIP_DIR_VARIABLE}",
        )
    return folder


def find_clip_parts(folder: Path) -> dict[str, Path]:
    """Those of `text`, `vision` and `tokenizer` that lie in `folder`, in the layout of which most
    is there."""
    return _best_layout(folder)[1]


def find_clip_files(folder: Path) -> ClipFiles:
    """The files of the layout that `folder` holds; RetrievalError names what is not there."""
    if not folder.is_dir():
        raise RetrievalError(
            "There is no such CLIP folder",
            where=folder,
            expected=_layouts(),
            fix=f"name the folder with --clip-dir or {CLIP_DIR_VARIABLE}, or run brrp fetch clip",
        )
    name, found = _best_layout(folder)
    missing = [" or ".join(LAYOUTS[name][part]) for part in LAYOUTS[name] if part not in found]
    if not missing:
        return ClipFiles(**found)
    if not found:
        raise RetrievalError(
            "The folder holds no CLIP model",
            where=folder,
            expected=_layouts(),
            found=_listing(folder),
            fix=f"brrp fetch clip --clip-dir {quote(str(folder))}",
        )
    raise RetrievalError(
        "The CLIP folder is not complete",
        where=folder,
        expected="; ".join(missing),
        found=", ".join(str(path.relative_to(folder)) for path in found.values()),
        fix=f"bring what is missing from huggingface.co/{name} (all from one repository); "
        f"brrp fetch clip --clip-dir {quote(str(folder))} brings all of {next(iter(LAYOUTS))}",
    )


def _best_layout(folder: Path) -> tuple[str, dict[str, Path]]:
    present = {name: _present(folder, layout) for name, layout in LAYOUTS.items()}
    # The layout of which most is there is the one the user means.
    name = max(present, key=lambda layout: len(present[layout]))
    return name, present[name]


def _present(folder: Path, layout: dict[str, tuple[str, ...]]) -> dict[str, Path]:
    places = {part: [folder / place for place in options] for part, options in layout.items()}
    return {
        part: next(path for path in paths if path.is_file())
        for part, paths in places.items()
        if any(path.is_file() for path in paths)
    }


def _layouts() -> str:
    return " | ".join(
        f"{name}: " + ", ".join(options[0] for options in layout.values())
        for name, layout in LAYOUTS.items()
    )


def _listing(folder: Path) -> str:
    names = sorted(path.name for path in folder.iterdir())
    return ", ".join(names[:10]) + (f" and {len(names) - 10} more" if len(names) > 10 else "") or (
        "an empty folder"
    )
