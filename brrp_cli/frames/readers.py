"""The readers of frames, found by what the path is."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from pathlib import Path

from brrp_cli.errors import FrameError
from brrp_cli.frames import formats
from brrp_cli.frames.format import Format, FrameRequest
from brrp_cli.frames.frame import Frame


@cache
def known_formats() -> tuple[Format, ...]:
    """Every format that has a file in `brrp_cli/frames/formats`, by the file's name."""
    names = sorted(module.name for module in pkgutil.iter_modules(formats.__path__))
    modules = [importlib.import_module(f"{formats.__name__}.{name}") for name in names]
    return tuple(module.FORMAT for module in modules)


def matching(path: Path) -> list[Format]:
    """The formats that the path may be of."""
    found = [one for one in known_formats() if not one.last and one.matches(path)]
    return found or [one for one in known_formats() if one.last and one.matches(path)]


def read_frame(
    path: str | Path, *, depth_scale: float | None = None, request: FrameRequest | None = None
) -> Frame:
    """Read a frame file (.npz, with or without masks), or a frame of any other known format.

    depth_scale : raw depth x depth_scale = metres, for files that do not tell their unit
    request : all else that a user may ask for

    Errors: FrameError, with the formats that are known where the path is of none or of several.
    """
    request = request or FrameRequest(depth_scale=depth_scale)
    return format_of(Path(path)).read(Path(path), request)


def list_frames(path: str | Path, request: FrameRequest | None = None) -> list[str]:
    """The frames of a source, as `FrameRequest.index` names them, in their order.

    A source of one frame has one, by the name of its file or folder. Errors: as of `read_frame`.
    """
    path = Path(path)
    found = format_of(path)
    if found.names is None:
        return [path.resolve().stem if path.is_file() else path.resolve().name]
    return found.names(path, request or FrameRequest())


def format_of(path: Path) -> Format:
    """The one format that the path is of. Errors: FrameError, as of `read_frame`."""
    if not path.exists():
        raise FrameError("No such file or folder", where=path, fix="check the path")
    found = matching(path)
    if len(found) == 1:
        return found[0]
    if found:
        raise FrameError(
            "The path may be of several formats",
            where=path,
            found="; ".join(f"{one.title} ({one.layout})" for one in found),
            fix="name one frame's files: --color C.png --depth D.png --intrinsics K.json",
        )
    inside = sorted(child.name for child in path.iterdir()) if path.is_dir() else [path.suffix]
    raise FrameError(
        "The folder is none of the layouts that are known"
        if path.is_dir()
        else "The file is of no format that is known",
        where=path,
        expected="; or ".join(f"{one.title} ({one.layout})" for one in known_formats()),
        found=", ".join(inside[:12]) or "an empty folder",
        fix="for other images: `brrp frame --color C.png --depth D.png --intrinsics K.json"
        " -o FRAME.npz`",
    )
