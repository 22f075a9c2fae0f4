"""GraspNet-1Billion: scenes/scene_SSSS/CAMERA/ with rgb/, depth/, label/ and meta/, CAMERA being
realsense or kinect.

meta/IIII.mat: intrinsic_matrix, pixels; factor_depth, units of depth to the metre. label/IIII.png:
0 = background, 1 + the number of the object's model. camera_poses.npy (n, 4, 4): every camera in
the frame of the first; cam0_wrt_table.npy (4, 4): the first in the frame of the table, metres. The
world is the table's frame. Layout and meaning: graspnetAPI.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.arrays import read_npy
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.format import Format, FrameRequest, pick
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.mat import read_meta
from brrp_cli.frames.pixels import read_colour, read_depth, read_masks
from brrp_cli.frames.recordings import COLOUR_ENDINGS, images_in

CAMERAS = ("realsense", "kinect")
POSES, TABLE = "camera_poses.npy", "cam0_wrt_table.npy"


def camera_folders(path: Path) -> dict[str, Path]:
    """Name -> folder of the cameras of a camera's folder, a scene, the scenes or the data set; of
    a camera's folder itself the name is empty."""
    if _is_camera(path):
        return {"": path}
    for pattern in ("*", "scene_*/*", "scenes/scene_*/*"):
        folders = [folder for folder in sorted(path.glob(pattern)) if folder.name in CAMERAS]
        found = [folder for folder in folders if _is_camera(folder)]
        if found:
            return {"/".join(f.relative_to(path).parts).removeprefix("scenes/"): f for f in found}
    return {}


def _is_camera(path: Path) -> bool:
    return all((path / name).is_dir() for name in ("rgb", "depth", "meta"))


def names(path: Path, request: FrameRequest) -> list[str]:
    """scene_SSSS/CAMERA/IIII of every image; less of it below that."""
    return [
        f"{name}/{stem}".removeprefix("/")
        for name, folder in camera_folders(path).items()
        for stem in images_in(folder / "rgb", COLOUR_ENDINGS)
    ]


def read(path: Path, request: FrameRequest) -> Frame:
    """The image that --index names or counts, the first else. Errors: FrameError."""
    why = "GraspNet's meta, which tells both"
    request.refuse(path, why, depth_scale="--depth-scale", intrinsics="--intrinsics")
    every = names(path, request)
    above, _, image = pick(every, request.index, every, path).rpartition("/")
    return read_view(camera_folders(path)[above], image)


def read_view(folder: Path, image: str) -> Frame:
    """The image IIII of a camera's folder, with ids of objects and the pose in the table's frame
    where the data set has them. Errors: FrameError."""
    meta = read_meta(folder / "meta" / f"{image}.mat")
    colour = images_in(folder / "rgb", COLOUR_ENDINGS).get(image, folder / "rgb" / f"{image}.png")
    label = folder / "label" / f"{image}.png"
    return make_frame(
        rgb=read_colour(colour),
        segmap=read_masks(label) if label.is_file() else None,
        depth=read_depth(folder / "depth" / f"{image}.png"),
        K=meta.K,
        T_world_cam=_pose(folder, image),
        depth_scale=meta.depth_scale,
        source=folder / image,
    )


def _pose(folder: Path, image: str) -> NDArray[Any] | None:
    """T_world_cam (4, 4), world = table; None without the two files."""
    poses, table = folder / POSES, folder / TABLE
    if not (poses.is_file() and table.is_file()):
        return None
    every, first = read_npy(poses), read_npy(table)
    number = int(image) if image.isdecimal() else -1
    if every.shape[1:] != (4, 4) or not 0 <= number < len(every):
        raise FrameError(
            "The image has no pose of its camera",
            where=poses,
            expected=f"(n, 4, 4) with n above {image}",
            found=every.shape,
        )
    for array, file in ((first, table), (every, poses)):
        if array.shape[-2:] != (4, 4) or array.dtype.kind not in "iuf":
            raise FrameError(
                "The poses of the camera cannot be read",
                where=file,
                expected="(4, 4) numbers a pose",
                found=f"shape {array.shape}, dtype {array.dtype}",
            )
    if first.ndim != 2:
        raise FrameError("One pose is expected", where=table, found=first.shape)
    return np.asarray(first.astype(np.float64) @ every[number].astype(np.float64))


FORMAT = Format(
    title="GraspNet-1Billion",
    layout="rgb/, depth/, meta/NNNN.mat, here or below scenes/scene_NNNN/{realsense,kinect}/",
    matches=lambda path: path.is_dir() and bool(camera_folders(path)),
    read=read,
    names=names,
)
