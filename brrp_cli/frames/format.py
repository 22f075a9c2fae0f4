"""What a format of frames is. Each has a file of its own in `brrp_cli/frames/formats`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from brrp_cli.errors import FrameError
from brrp_cli.frames.frame import Frame

T = TypeVar("T")

_DIGITS = 19


@dataclass(frozen=True)
class FrameRequest:
    """What a user asks for beside the path; None = the format decides.

    index : which frame of many: its number from 0, or the name that the format gives it
    depth_scale : raw depth x depth_scale = metres
    intrinsics : JSON file
    color_topic, depth_topic : of a bag
    """

    index: str | None = None
    depth_scale: float | None = None
    intrinsics: Path | None = None
    color_topic: str | None = None
    depth_topic: str | None = None

    def refuse(self, path: Path, why: str, **names: str) -> None:
        """FrameError if an option was given that the format has no use for.

        names : field -> the option as it is typed
        """
        given = [option for field, option in names.items() if getattr(self, field) is not None]
        if given:
            raise FrameError(
                f"{', '.join(given)} means nothing here",
                where=path,
                expected=why,
                fix=f"leave {', '.join(given)} out",
            )


@dataclass(frozen=True)
class Format:
    """A layout on disk.

    title : as messages name it; layout : the files that tell it
    matches : whether a path looks like it, by names alone
    read : the frame, without masks where the format has none. Errors: FrameError
    names : the frames of a source that may hold many, as `FrameRequest.index` names them, in their
        order; None for a format of one frame. Errors: FrameError
    contents : what else is in it, a line each, for `--list`. Errors: FrameError
    last : counts only where no other format matches
    """

    title: str
    layout: str
    matches: Callable[[Path], bool]
    read: Callable[[Path, FrameRequest], Frame]
    names: Callable[[Path, FrameRequest], list[str]] | None = None
    contents: Callable[[Path, FrameRequest], list[str]] | None = None
    last: bool = False


def as_number(index: str) -> int | None:
    """The number that an index is; None where it is a name."""
    return int(index) if index.isdecimal() and len(index) < _DIGITS else None


def pick(items: list[T], index: str | None, names: list[str], path: Path) -> T:
    """The item that `index` names or counts, from 0; the first where nobody says.

    Errors: FrameError if there is none.
    """
    if not items:
        raise FrameError("There is no frame here", where=path)
    if index is None:
        return items[0]
    if index in names:
        return items[names.index(index)]
    number = as_number(index)
    if number is not None and number < len(items):
        return items[number]
    shown = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
    raise FrameError(
        "There is no such frame",
        where=path,
        expected=f"0 to {len(items) - 1}, or a name: {shown}",
        found=index,
    )
