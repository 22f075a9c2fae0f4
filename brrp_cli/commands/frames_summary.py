"""What --frames writes of all frames together: frames.json, and one BOP results file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from brrp_cli.commands.beside import POSES
from brrp_cli.files import parse_json, write_bytes
from brrp_cli.progress import note
from brrp_cli.results.bop import numbers_image
from brrp_cli.results.write import RECORD

SUMMARY = "frames.json"


def earlier_frames(
    output: Path, source: str, settings: dict[str, Any]
) -> dict[str, dict[str, Any]]:
    """What earlier calls with the same source and settings told of each frame, by its name."""
    try:
        table = parse_json((output / SUMMARY).read_text(encoding="utf-8"))
        same = table["source"] == source and table["settings"] == plain(settings)
        told = {each["frame"]: each for each in table["frames"]} if same else {}
        return {name: each for name, each in told.items() if (output / each["folder"]).is_dir()}
    except (OSError, ValueError, KeyError, TypeError):  # of another version, or damaged
        return {}


def was_tracked(output: Path) -> bool | None:
    """Whether the last call was with --track; None where nobody can tell."""
    try:
        return "track" in parse_json((output / SUMMARY).read_text(encoding="utf-8"))["settings"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def plain(settings: dict[str, Any]) -> dict[str, Any]:
    """As they are read back from JSON."""
    read: dict[str, Any] = json.loads(json.dumps(settings))
    return read


def write_summary(
    output: Path, source: str, settings: dict[str, Any], told: list[dict[str, Any]]
) -> None:
    """frames.json: what became of every frame. Errors: OutputError."""
    table = {"source": source, "settings": settings, "frames": told}
    write_bytes(output / SUMMARY, (json.dumps(table, indent=1) + "\n").encode())


def join_poses(
    output: Path, told: list[dict[str, Any]], every: list[str], source: Path | None = None
) -> None:
    """One BOP results file of all frames that have one. Where the names of frames do not tell
    different images, each frame has its place among `every` of the source as im_id."""
    paths = {each["frame"]: output / each["folder"] / POSES for each in told}
    texts = {name: path.read_text().splitlines() for name, path in paths.items() if path.is_file()}
    if not texts:
        return
    rows = {name: [row.split(",", 2) for row in text[1:]] for name, text in texts.items()}
    images = [key for each in rows.values() for key in {(scene, im) for scene, im, _ in each}]
    sources = {_source(paths[name].parent) for name in texts}
    # The name of a bag is no frame's own.
    own = len(every) == 1 or source not in sources
    numbered = own and all(map(numbers_image, sources))
    if not numbered or len(set(images)) < len(images):
        note(
            f"{POSES}: names tell no image numbers; im_id is a frame's place in the source, from 0"
        )
        rows = {
            name: [["0", str(every.index(name)), rest] for _, _, rest in each]
            for name, each in rows.items()
        }
    header = next(iter(texts.values()))[0]
    lines = [header, *(",".join(row) for each in rows.values() for row in each)]
    write_bytes(output / POSES, ("\n".join(lines) + "\n").encode())


def _source(folder: Path) -> Path | None:
    """What the results in a folder are of; None where they do not tell."""
    try:
        return Path(parse_json((folder / RECORD).read_text(encoding="utf-8"))["source"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
