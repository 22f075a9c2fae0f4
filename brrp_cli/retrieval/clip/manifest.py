"""Which bytes CLIP ViT-B/16 is: `data_manifests/clip.toml`, and the models that belong together."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from brrp_cli.errors import RetrievalError
from brrp_cli.fetch.fetch import RemoteFile

MANIFEST = Path(__file__).parents[2] / "data_manifests" / "clip.toml"
PRECISIONS = ("full", "8bit")


@dataclass(frozen=True)
class ClipManifest:
    """The published files of one training of CLIP.

    address : base of the files' addresses; files : those of each precision; text, vision : sha256
    of the models, of any precision. Every text model belongs to every vision model.
    """

    address: str
    files: dict[str, list[RemoteFile]]
    text: frozenset[str]
    vision: frozenset[str]


def read_clip_manifest() -> ClipManifest:
    """The manifest that the package brings."""
    table = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))

    def sums(part: str) -> frozenset[str]:
        return frozenset(entry["sha256"] for entry in table["files"] if entry["part"] == part)

    return ClipManifest(
        address=table["address"],
        files={
            precision: [
                RemoteFile(entry["path"], entry["bytes"], entry["sha256"])
                for entry in table["files"]
                if entry.get("precision", precision) == precision
            ]
            for precision in PRECISIONS
        },
        text=sums("text"),
        vision=sums("vision"),
    )


def known_pair(text_sha256: str, vision_sha256: str) -> bool | None:
    """Whether the manifest says that two models belong together; None where it knows neither."""
    manifest = read_clip_manifest()
    if text_sha256 not in manifest.text and vision_sha256 not in manifest.vision:
        return None
    return text_sha256 in manifest.text and vision_sha256 in manifest.vision


def refuse_mismatch(text_sha256: str, vision_sha256: str, *, text: object, vision: object) -> None:
    """RetrievalError if one of two models is a published one and the other not its partner.

    CLIPs of other trainings give embeddings of the same size; only their bytes tell them apart.
    text, vision : where the two come from.
    """
    if known_pair(text_sha256, vision_sha256) is not False:
        return
    manifest = read_clip_manifest()
    known_vision = vision_sha256 in manifest.vision
    partners = manifest.text if known_vision else manifest.vision
    raise RetrievalError(
        "CLIP's text and vision models do not belong together",
        where=f"{text} and {vision}",
        expected=f"{'text' if known_vision else 'vision'} model with the sha256 "
        + " or ".join(f"{partner[:12]}..." for partner in sorted(partners)),
        found=f"{(text_sha256 if known_vision else vision_sha256)[:12]}...",
        fix="take both models from one repository: brrp fetch clip",
    )
