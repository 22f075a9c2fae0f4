"""Results of frames that are there already, and whether they are those that are asked for."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brrp_cli.commands.frames_summary import plain
from brrp_cli.errors import FrameError, OutputError, ResultError
from brrp_cli.progress import hushed, progress

if TYPE_CHECKING:
    from brrp_cli.frames.frame import Frame
    from brrp_cli.results.read import StoredResult

SHOWN = 5  # settings that differ


def results_with(folder: Path, settings: dict[str, Any]) -> StoredResult | None:
    """The results of a frame, where they are there. Errors: OutputError where other settings made
    them."""
    if not folder.exists():
        return None
    from brrp_cli.api import open_result

    try:
        stored = open_result(folder)
    except ResultError:
        return None
    record = stored.record
    prior = record.get("prior")
    found = {key: record.get(key) for key in settings}
    found["prior"] = prior.get("digest") if isinstance(prior, dict) else None
    wanted = plain(settings)
    if found["segmentation"] is None:  # its masks came with it
        found["segmentation"] = wanted["segmentation"]
    if found["masks"] is None:  # these, too: nobody made them by a prompt
        found["masks"] = wanted["masks"] | {"prompt": None}
    one, other = _flat(wanted), _flat(found)
    different = sorted(key for key in one.keys() | other.keys() if one.get(key) != other.get(key))
    if different:
        raise OutputError(
            "A frame was reconstructed with other settings before",
            where=folder,
            expected=_shown(one, different),
            found=_shown(other, different),
            fix="choose another folder with -o, or pass --overwrite to do all frames again",
        )
    return stored


def of_what_is_read(
    there: Mapping[str, StoredResult], read: Callable[[str], Frame]
) -> tuple[dict[str, StoredResult], list[str]]:
    """Those of the results that are of what the source holds now, and the names of frames whose
    images or masks have changed. Results that do not tell of what they are count as the same; a
    frame that cannot be read is neither. Errors: OutputError for results of another source.

    read : a frame by its name; FrameError where it cannot be read
    """
    from brrp_cli.results.frame_digest import frame_digest

    same: dict[str, StoredResult] = {}
    changed = []
    # What there is to say of a frame is said where it is done.
    with hushed(below=logging.ERROR):
        for name, stored in progress(there.items(), "what is there", len(there)):
            digest = stored.record.get("source_sha256")
            if digest is None:
                same[name] = stored
                continue
            try:
                frame = read(name)
            except FrameError:  # told where the frame is done
                continue
            if digest == frame_digest(frame):
                same[name] = stored
            else:
                _check_source(stored, frame)
                changed.append(name)
    return same, changed


def _check_source(stored: StoredResult, read: Frame) -> None:
    """OutputError for results of a frame of that name of another source: nobody asked for them to
    be replaced, as those of a frame that was corrected are."""
    before = stored.record.get("source")
    if Path(str(before)).resolve() != Path(str(read.source)).resolve():
        raise OutputError(
            "A frame of this name was reconstructed from another source before",
            where=stored.folder,
            expected=f"results of {read.source}",
            found=f"results of {before}, which are others",
            fix="choose another folder with -o, or pass --overwrite to do all frames again",
        )


def _flat(settings: dict[str, Any], above: str = "") -> dict[str, Any]:
    """Values by dotted names."""
    flat: dict[str, Any] = {}
    for key, value in settings.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{above}{key}.")
        else:
            flat[f"{above}{key}"] = value
    return flat


def _spelled(value: object) -> str:
    """As JSON and TOML have it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _shown(settings: dict[str, Any], keys: list[str]) -> str:
    shown = [
        f"no {key}" if settings.get(key) is None else f"{key} {_spelled(settings[key])}"
        for key in keys[:SHOWN]
    ]
    more = len(keys) - SHOWN
    return ", ".join(shown) + (f", and {more} more" if more > 0 else "")
