"""Azure Kinect recordings as Open3D's azure_kinect_mkv_reader.py leaves them: color/NNNNN.jpg,
depth/NNNNN.png in millimetres, aligned to the colour camera, and intrinsic.json of that camera."""

from __future__ import annotations

from pathlib import Path

from brrp_cli.frames.format import Format, Request
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.recordings import COLOUR_ENDINGS, DEPTH_ENDINGS, by_name, images_in, read_pair

INTRINSICS = "intrinsic.json"


def read(folder: Path, request: Request) -> Frame:
    """The frame that --index names or counts, the first else. Errors: FrameError."""
    pairs = by_name(
        images_in(folder / "color", COLOUR_ENDINGS), images_in(folder / "depth", DEPTH_ENDINGS)
    )
    return read_pair(pairs, folder / INTRINSICS, request, folder, "the Azure Kinect's unit")


FORMAT = Format(
    title="an Azure Kinect recording",
    layout=f"color/, depth/, {INTRINSICS}",
    matches=lambda path: (path / INTRINSICS).is_file() and (path / "color").is_dir(),
    read=read,
)
