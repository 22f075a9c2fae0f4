"""The readers of frames, found by what the path is."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from brrp_cli.errors import FrameError
from brrp_cli.frames import brrp_real, published
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import load_frame


class FolderReader(Protocol):
    """Reads a folder of one layout."""

    def __call__(self, folder: Path, *, depth_scale: float | None) -> Frame:
        """The folder's frame. Errors: FrameError."""


# Layout -> (the files that tell it, its reader).
_FOLDERS: dict[str, tuple[tuple[str, ...], FolderReader]] = {
    "BRRP's real scene": (brrp_real.FILES, brrp_real.read_brrp_real),
    "a view of a published scene": (published.FILES, published.read_published),
}


def read_frame(path: str | Path, *, depth_scale: float | None = None) -> Frame:
    """Read a frame file (.npz, with or without masks), or a folder of a known layout.

    depth_scale : raw depth x depth_scale = metres, for files that do not tell their unit

    Errors: FrameError, with the layouts that are known where the path is none of them.
    """
    path = Path(path)
    if not path.is_dir():
        return load_frame(path, depth_scale=depth_scale, masks=False)
    for files, read in _FOLDERS.values():
        if all((path / name).is_file() for name in files):
            return read(path, depth_scale=depth_scale)
    inside = sorted(child.name for child in path.iterdir())
    raise FrameError(
        "The folder is none of the layouts that are known",
        where=path,
        expected="; or ".join(
            f"{name} ({', '.join(files)})" for name, (files, _) in _FOLDERS.items()
        ),
        found=", ".join(inside[:12]) or "an empty folder",
        fix="for other images: `brrp frame --color C.png --depth D.png --intrinsics K.json"
        " -o FRAME.npz`",
    )
