"""A folder of frames that no known recorder wrote: color.png and depth.png, NAME-color.png and
NAME-depth.png (also with _ or . and with rgb), or the same names below rgb/ or color/ and depth/.

Intrinsics are the one JSON file whose name speaks of a camera, or GraspNet's meta.mat, here or in
the folder above.
"""

from __future__ import annotations

import re
from pathlib import Path

from brrp_cli.errors import FrameError
from brrp_cli.frames.format import Format, FrameRequest
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.recordings import (
    COLOUR_ENDINGS,
    DEPTH_ENDINGS,
    by_name,
    images_in,
    pairs_below,
    read_pair,
)

_COLOUR = re.compile(r"^(.*?)[-_.]?(?:color|colour|rgb)$", re.IGNORECASE)
_DEPTH = re.compile(r"^(.*?)[-_.]?depth$", re.IGNORECASE)
_CAMERA = re.compile(r"camera|intrinsic|calib|^k$", re.IGNORECASE)
_COLOUR_FOLDERS = ("color", "colour", "rgb", "image", "images")


def pairs_in(folder: Path) -> dict[str, tuple[Path, Path]]:
    """Name -> (colour, depth) of the frames in a folder, by name; `0` where they have none."""
    for name in _COLOUR_FOLDERS:
        pairs = pairs_below(folder, name)
        if pairs:
            return pairs
    colours = _named(images_in(folder, COLOUR_ENDINGS), _COLOUR)
    return by_name(colours, _named(images_in(folder, DEPTH_ENDINGS), _DEPTH))


def _named(files: dict[str, Path], pattern: re.Pattern[str]) -> dict[str, Path]:
    found = {stem: pattern.match(stem) for stem in files}
    return {match[1] or "0": files[stem] for stem, match in found.items() if match}


def find_intrinsics(folder: Path) -> Path:
    """The JSON file of the camera, in the folder or in the one above. Errors: FrameError."""
    for place in (folder, folder.resolve().parent):
        found = sorted(path for path in place.glob("*.json") if _CAMERA.search(path.stem))
        found += [path for path in [place / "meta.mat"] if path.is_file()]
        if len(found) == 1:
            return found[0]
        if found:
            raise FrameError(
                "Several files could hold the intrinsics",
                where=place,
                found=", ".join(path.name for path in found),
                fix="name the right one: --intrinsics K.json",
            )
    raise FrameError(
        "No intrinsics were found",
        where=folder,
        expected="a JSON file whose name speaks of a camera or intrinsics, or meta.mat, here or one"
        " folder up",
        fix="pass --intrinsics K.json",
    )


def read(folder: Path, request: FrameRequest) -> Frame:
    """The frame that --index names or counts, the first else. Errors: FrameError."""
    intrinsics = request.intrinsics or find_intrinsics(folder)
    unit = "assumed; --depth-scale says otherwise"
    return read_pair(pairs_in(folder), intrinsics, request, folder, unit)


FORMAT = Format(
    title="a folder of frames",
    layout="color.png, depth.png; NAME-color.png, NAME-depth.png; or color/NAME, depth/NAME",
    matches=lambda path: path.is_dir() and bool(pairs_in(path)),
    read=read,
    names=lambda path, request: list(pairs_in(path)),
    last=True,
)
