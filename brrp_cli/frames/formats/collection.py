"""A folder of frames: frame files, views, recordings, each of a format of its own.

Its frames are named after the files and folders in it: NAME, or NAME/FRAME where NAME holds many.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

from brrp_cli.errors import FrameError
from brrp_cli.frames.format import Format, FrameRequest, as_number
from brrp_cli.frames.formats.folder import pairs_in
from brrp_cli.frames.frame import Frame

log = logging.getLogger(__name__)


def parts_in(path: Path) -> dict[str, Path]:
    """Name -> what is of exactly one other format, by name; hidden files are left out."""
    inside = sorted(child for child in path.iterdir() if not child.name.startswith("."))
    return {child.name: child for child in inside if _format_of(child) is not None}


def _format_of(path: Path) -> Format | None:
    from brrp_cli.frames.readers import known_formats

    if path.suffix == ".npy":  # an array that lies about; a reader only tells what it is not
        return None

    others = [one for one in known_formats() if one is not FORMAT]
    found = [one for one in others if not one.last and one.matches(path)]
    found = found or [one for one in others if one.last and one.matches(path)]
    return found[0] if len(found) == 1 else None


def names(path: Path, request: FrameRequest) -> list[str]:
    """NAME, or NAME/FRAME, of every frame. Errors: FrameError of any part."""
    found = []
    for name, part in parts_in(path).items():
        one = _format_of(part)
        assert one is not None
        inside = [] if one.names is None else one.names(part, request)
        found += [f"{name}/{each}" for each in inside] if len(inside) > 1 else [name]
    return found


def read(path: Path, request: FrameRequest) -> Frame:
    """The frame that --index names, or counts among all; the first else. Errors: FrameError."""
    parts = parts_in(path)
    index = request.index
    if index is None:
        index = next(iter(parts))
    elif index.partition("/")[0] not in parts:
        every, number = names(path, request), as_number(index)
        if number is None or number >= len(every):
            shown = ", ".join(every[:4]) + (", ..." if len(every) > 4 else "")
            raise FrameError(
                "There is no such frame",
                where=path,
                expected=f"0 to {len(every) - 1}, or a name: {shown}",
                found=index,
            )
        index = every[number]
    name, _, inside = index.partition("/")
    one = _format_of(parts[name])
    assert one is not None
    log.info("Frame: %s of %s", index, path)
    return one.read(parts[name], replace(request, index=inside or None))


def _matches(path: Path) -> bool:
    if not path.is_dir() or pairs_in(path):
        return False
    return any(_format_of(child) is not None for child in sorted(path.iterdir()))


FORMAT = Format(
    title="a folder of frames of these formats",
    layout="files or folders, each of one of the other formats",
    matches=_matches,
    read=read,
    names=names,
    last=True,
)
