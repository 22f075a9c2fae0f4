"""TUM RGB-D sequences: rgb.txt, depth.txt, groundtruth.txt and the images that they name.

Colour and depth have times of their own: the nearest depth within 0.02 s belongs to a colour image
(as the data set's associate.py has it). 5000 in a depth image is one metre. groundtruth.txt holds
time tx ty tz qx qy qz qw of the colour camera in the world. The folder does not hold intrinsics;
those published for its three cameras are taken by the sequence's name.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.files import trouble_of
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.format import Format, FrameRequest, pick
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.intrinsics import read_intrinsics
from brrp_cli.frames.pixels import read_colour, read_depth

log = logging.getLogger(__name__)

METRES_PER_UNIT = 1 / 5000
_APART = 0.02  # seconds
# fx, fy, cx, cy of the colour cameras, as the data set's page of file formats lists them.
_CAMERAS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}


def read(folder: Path, request: FrameRequest) -> Frame:
    """A colour image, by its place or its time, with the depth and the pose that belong to it.

    Errors: FrameError, also where no depth is near it in time or nobody tells the intrinsics.
    """
    pairs = _pairs(folder)
    time, colour, depth = pick(pairs, request.index, [time for time, _, _ in pairs], folder)
    return make_frame(
        rgb=read_colour(folder / colour),
        depth=read_depth(folder / depth),
        K=_intrinsics(folder, request),
        T_world_cam=_pose(folder / "groundtruth.txt", float(time)),
        depth_scale=request.depth_scale or METRES_PER_UNIT,
        source=folder / colour,
    )


def names(folder: Path, request: FrameRequest) -> list[str]:
    """The times of the colour images that have depth. Errors: FrameError."""
    return [time for time, _, _ in _pairs(folder)]


def _pairs(folder: Path) -> list[tuple[str, str, str]]:
    """(time, colour image, depth image) of every pair. Errors: FrameError, also for none."""
    colours, depths = (_listed(folder / name) for name in ("rgb.txt", "depth.txt"))
    times = np.array([float(time) for time, _ in depths])
    pairs = []
    for time, path in colours:
        nearest = int(np.argmin(np.abs(times - float(time)))) if len(times) else -1
        if nearest >= 0 and abs(times[nearest] - float(time)) <= _APART:
            pairs.append((time, path, depths[nearest][1]))
    if not pairs:
        raise FrameError(
            "No colour image has a depth image near it in time",
            where=folder,
            expected=f"within {_APART} s, as rgb.txt and depth.txt tell",
        )
    return pairs


def _listed(path: Path) -> list[tuple[str, str]]:
    """(time, file) of each line that is no comment. Errors: FrameError."""
    try:
        return sorted(((row[0], row[1]) for row in _rows(path)), key=lambda row: float(row[0]))
    except (OSError, ValueError, IndexError) as error:
        raise FrameError(
            "The list cannot be read",
            where=path,
            expected="lines of a time in seconds and a file",
            found=trouble_of(error),
        ) from error


def _rows(path: Path) -> list[list[str]]:
    """The words of each line that is no comment. Errors: OSError, ValueError."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [line.split() for line in lines if line.strip() and not line.startswith("#")]


def _intrinsics(folder: Path, request: FrameRequest) -> NDArray[np.float64]:
    if request.intrinsics is not None:
        return read_intrinsics(request.intrinsics).K
    name = folder.resolve().name.lower()
    camera = next((key for key in _CAMERAS if key in name), None)
    if camera is None:
        raise FrameError(
            "A TUM folder holds no intrinsics, and its name does not tell the camera",
            where=folder,
            expected=f"a name with {', '.join(_CAMERAS)}, or --intrinsics K.json",
            found=name,
            fix="pass --intrinsics K.json",
        )
    fx, fy, cx, cy = _CAMERAS[camera]
    log.info("Intrinsics: those published for %s, fx %g fy %g cx %g cy %g", camera, fx, fy, cx, cy)
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _pose(path: Path, time: float) -> NDArray[np.float64] | None:
    """T_world_cam (4, 4) nearest in time; None where there is none within 0.02 s."""
    if not path.is_file():
        return None
    rotation = import_library("scipy.spatial.transform").Rotation
    try:
        poses = np.array(_rows(path), dtype=np.float64)
        if poses.ndim != 2 or poses.shape[1] != 8:
            raise ValueError(f"{len(poses)} lines, not all of 8 numbers")
        near = poses[np.argmin(np.abs(poses[:, 0] - time))]
        if not abs(near[0] - time) <= _APART:
            return None
        T = np.eye(4)
        T[:3, :3] = rotation.from_quat(near[4:8]).as_matrix()
        T[:3, 3] = near[1:4]
        return T
    except (OSError, ValueError) as error:
        raise FrameError(
            "The poses cannot be read",
            where=path,
            expected="lines of time tx ty tz qx qy qz qw",
            found=trouble_of(error),
        ) from error


FORMAT = Format(
    title="a TUM RGB-D sequence",
    layout="rgb.txt, depth.txt",
    matches=lambda path: (path / "rgb.txt").is_file() and (path / "depth.txt").is_file(),
    read=read,
    names=names,
)
