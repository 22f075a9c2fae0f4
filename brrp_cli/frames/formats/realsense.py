"""RealSense recordings as Open3D's realsense_recorder.py leaves them: color/NNNNNN.jpg,
depth/NNNNNN.png, aligned to the colour camera, and camera_intrinsic.json of that camera.

The recorder writes raw Z16 and not its unit. D400 cameras count millimetres unless told otherwise;
an L515 counts quarters of one: --depth-scale 0.00025.
"""

from __future__ import annotations

from pathlib import Path

from brrp_cli.frames.format import Format, Request
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.recordings import COLOUR_ENDINGS, DEPTH_ENDINGS, by_name, images_in, read_pair

INTRINSICS = "camera_intrinsic.json"


def read(folder: Path, request: Request) -> Frame:
    """The frame that --index names or counts, the first else. Errors: FrameError."""
    pairs = by_name(
        images_in(folder / "color", COLOUR_ENDINGS), images_in(folder / "depth", DEPTH_ENDINGS)
    )
    unit = "D400 cameras' unit; an L515 needs --depth-scale 0.00025"
    return read_pair(pairs, folder / INTRINSICS, request, folder, unit)


FORMAT = Format(
    title="a RealSense recording",
    layout=f"color/, depth/, {INTRINSICS}",
    matches=lambda path: (path / INTRINSICS).is_file() and (path / "color").is_dir(),
    read=read,
)
