"""One view of a scene in the published layout of V-PRISM's and BRRP's data sets."""

from __future__ import annotations

from pathlib import Path

from brrp_cli.frames.format import Format, FrameRequest
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.published import FILES, read_published


def read(folder: Path, request: FrameRequest) -> Frame:
    """See `read_published`. Errors: FrameError."""
    request.refuse(folder, "one view, with its camera", index="--index", intrinsics="--intrinsics")
    return read_published(folder, depth_scale=request.depth_scale)


FORMAT = Format(
    title="a view of a published scene",
    layout=", ".join(FILES),
    matches=lambda path: all((path / name).is_file() for name in FILES),
    read=read,
)
