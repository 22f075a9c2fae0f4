"""BRRP's own real scenes: a folder with rgb.jpg, xyz.npy and segmentation.npy."""

from __future__ import annotations

from pathlib import Path

from brrp_cli.frames.arrays import read_npy
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.pixels import read_colour

FILES = ("rgb.jpg", "xyz.npy", "segmentation.npy")


def read_brrp_real(folder: str | Path, *, depth_scale: float | None = None) -> Frame:
    """Read a folder of BRRP's real scenes; K is fitted to the points.

    Errors: FrameError, also where the points are no pinhole image in the camera frame.
    """
    folder = Path(folder)
    rgb, xyz, segmentation = (folder / name for name in FILES)
    return make_frame(
        read_colour(rgb),
        read_npy(segmentation),
        xyz=read_npy(xyz),
        depth_scale=depth_scale,
        source=folder,
    )
