"""Which files make masks by a prompt, and where they lie: `data_manifests/masks.toml`."""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

from brrp_cli.errors import MaskError
from brrp_cli.fetch.fetch import RemoteFile

MANIFEST = Path(__file__).parents[2] / "data_manifests" / "masks.toml"
MASKS_DIR_VARIABLE = "BRRP_MASKS_DIR"
# Of the detector; the segmenter has one alone.
PRECISIONS = ("full", "4bit")
# Part -> where it may lie below the folder, the best first.
_PLACES = {
    "detector": ("detector/onnx/model.onnx", "detector/onnx/model_q4f16.onnx"),
    "tokenizer": ("detector/tokenizer.json",),
    "encoder": ("segmenter/mobile_sam_image_encoder.onnx",),
    "decoder": ("segmenter/sam_mask_decoder_single.onnx",),
}


@dataclass(frozen=True)
class MaskFiles:
    """The four files: the detector with its tokenizer, and the segmenter's two halves."""

    detector: Path
    tokenizer: Path
    encoder: Path
    decoder: Path


@dataclass(frozen=True)
class Repository:
    """Files of one address, which go into the folder of that name."""

    name: str
    address: str
    files: list[RemoteFile]


def read_mask_manifest(precision: str) -> list[Repository]:
    """What to fetch for that precision of the detector."""
    table = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))
    return [
        Repository(
            name,
            address,
            [
                RemoteFile(entry["path"], entry["bytes"], entry["sha256"])
                for entry in table["files"]
                if entry["repository"] == name and entry.get("precision", precision) == precision
            ],
        )
        for name, address in table["repositories"].items()
    ]


def masks_folder(named: Path | None) -> Path:
    """The folder that was named, else the one in BRRP_MASKS_DIR, else the user's cache."""
    import platformdirs

    variable = os.environ.get(MASKS_DIR_VARIABLE)
    cache = Path(platformdirs.user_cache_dir("brrp")) / "masks"
    return named or (Path(variable) if variable else cache)


def find_mask_files(named: Path | None) -> MaskFiles:
    """The files in `masks_folder`. Errors: MaskError that names what is missing."""
    folder = masks_folder(named)
    found = {
        part: next((folder / place for place in places if (folder / place).is_file()), None)
        for part, places in _PLACES.items()
    }
    missing = [_PLACES[part][0] for part, path in found.items() if path is None]
    if missing:
        raise MaskError(
            "The models that make masks by a prompt are not there",
            where=folder,
            expected=", ".join(missing),
            fix="brrp fetch masks, or name their folder with --masks-dir or"
            f" {MASKS_DIR_VARIABLE}; --segment needs no model",
        )
    return MaskFiles(**{part: path for part, path in found.items() if path is not None})
