"""BRRP's own real scenes: a folder with rgb.jpg, xyz.npy and segmentation.npy."""

from __future__ import annotations

from pathlib import Path

from brrp_cli.frames.arrays import read_npy
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.format import Format, FrameRequest
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.pixels import read_colour

FILES = ("rgb.jpg", "xyz.npy", "segmentation.npy")


def read(folder: Path, request: FrameRequest) -> Frame:
    """Read a folder of BRRP's real scenes; K is fitted to the points.

    Errors: FrameError, also where the points are no pinhole image in the camera frame.
    """
    request.refuse(
        folder, "one frame, whose points tell K", index="--index", intrinsics="--intrinsics"
    )
    rgb, xyz, segmentation = (folder / name for name in FILES)
    return make_frame(
        rgb=read_colour(rgb),
        segmap=read_npy(segmentation),
        xyz=read_npy(xyz),
        depth_scale=request.depth_scale,
        source=folder,
    )


FORMAT = Format(
    title="BRRP's real scene",
    layout=", ".join(FILES),
    matches=lambda path: all((path / name).is_file() for name in FILES),
    read=read,
)
