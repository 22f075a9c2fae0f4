"""Arrays of any source to a checked `Frame`: the one place where a frame's checks stand."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrp_cli.config.observation import ScatteredHolesConfig
from brrp_cli.errors import FrameError
from brrp_cli.frames.camera import check_intrinsics, check_pose, fit_intrinsics
from brrp_cli.frames.frame import ONE_CAMERA, Frame
from brrp_cli.frames.masks import MAX_OBJECTS, check_masks
from brrp_cli.frames.metres import depth_metres, points_metres
from brrp_cli.frames.misplaced import advice, swapped
from brrp_cli.frames.scattered_holes import without_scattered_holes
from brrp_cli.geometry import backproject
from brrp_cli.spoken import counted, option

log = logging.getLogger(__name__)

_GREY = 128


def make_frame(
    *,
    rgb: ArrayLike | None = None,
    segmap: ArrayLike | None = None,
    depth: ArrayLike | None = None,
    K: ArrayLike | None = None,
    xyz: ArrayLike | None = None,
    T_world_cam: ArrayLike | None = None,
    depth_scale: float | None = None,
    source: Path | None = None,
    files: Mapping[str, Path] | None = None,
    background_told: bool = False,
) -> Frame:
    """Check one camera's arrays and make a frame of them. The arrays are copied, never changed.
    Holes in depth that are scattered all over the image are filled (scattered_holes.py).

    All arguments go by name, and an array under another's name is told: colour and depth that are
    swapped would make a frame of nothing.

    Parameters
    ----------
    rgb : (H, W, 3) uint8; None = grey
    segmap : (H, W) integers (or floats that hold integers), 0 = background, any other id but -1 is
        an object; None = no masks yet (for `segment`)
    depth : (H, W), along z. Floats are metres, integers millimetres, unless `depth_scale` is
        given; 0, NaN, inf and the largest number of an unsigned type = no return
    K : (3, 3) pinhole intrinsics, pixels; needed with `depth`, fitted where `xyz` comes without
    xyz : (H, W, 3) points instead of `depth`, metres, camera frame (x right, y down, z forward)
    T_world_cam : (4, 4) rigid transform, camera frame to world frame
    depth_scale : raw value x depth_scale = metres
    source : file or folder, for messages
    files : the file of single arrays, for messages, where they have one each: array's name -> path
    background_told : whether something beside the masks tells which of their ids are background, as
        a scene's true objects do: no id is refused then

    Errors: FrameError, which names the array, what was expected and what was found.
    """
    where = {name: (files or {}).get(name, source) for name in ("rgb", "segmap", "depth", "K")}
    if depth is not None and segmap is not None and swapped(depth, segmap, MAX_OBJECTS):
        raise FrameError(
            "depth and segmap seem to be swapped",
            where=where["depth"],
            expected="depth with many values; segmap with few, which are whole",
            found=f"depth {_told(np.asarray(depth))}, segmap {_told(np.asarray(segmap))}",
            fix=f"swap {option('depth')} and {option('masks') if files else 'segmap'}",
        )
    if depth is not None:
        if K is None:
            raise FrameError(
                "Depth without intrinsics",
                where=source,
                expected="K, (3, 3)",
                found="no K",
                fix="pass K = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] of the camera, in pixels",
            )
        z = depth_metres(np.asarray(depth), depth_scale, where["depth"])
        height, width = z.shape
        if np.shape(K) == (3, 3):  # else depth and K may be swapped, which K's own check tells
            _refuse_other_sizes((height, width), rgb, segmap, where)
        K_checked = check_intrinsics(np.asarray(K), (height, width), where["K"])
        points = backproject(z, K_checked)
    elif xyz is not None:
        points = points_metres(np.asarray(xyz), depth_scale, source)
        height, width = points.shape[:2]
        _refuse_other_sizes((height, width), rgb, segmap, where)
        given = None if K is None else check_intrinsics(np.asarray(K), (height, width), source)
        K_checked = fit_intrinsics(points, given, source)
    else:
        raise FrameError(
            "Neither depth nor points", where=source, expected="depth and K, or xyz", found="none"
        )
    points = _without_holes(points, K_checked, source)
    if rgb is None:
        log.info("%s has no colour: grey stands in for it", source or "The frame")
    shape = height, width
    grey, nowhere = np.full((*shape, 3), _GREY, np.uint8), np.zeros(shape, np.int64)
    return Frame(
        rgb=grey if rgb is None else _colour(rgb, where["rgb"]),
        points=points,
        segmap=nowhere
        if segmap is None
        else check_masks(segmap, where["segmap"], background_told=background_told),
        K=K_checked,
        T_world_cam=None if T_world_cam is None else check_pose(np.asarray(T_world_cam), source),
        source=source,
    )


def require_frame(given: object) -> Frame:
    """The frame itself. Errors: FrameError for anything else, such as the path of one."""
    if isinstance(given, Frame):
        return given
    raise FrameError(
        "That is no frame",
        expected="a Frame",
        found=f"{type(given).__name__} {given}"
        if isinstance(given, str | Path)
        else type(given).__name__,
        fix='read a file with load_frame("frame.npz"), or check arrays with make_frame(...)',
    )


def require_objects(frame: Frame) -> Frame:
    """The frame itself. Errors: FrameError if its mask has no object, or if it is no frame."""
    require_frame(frame)
    if not frame.object_ids:
        raise FrameError(
            "There is no object in the mask",
            where=frame.source,
            expected="at least one pixel that is not 0",
            found="0 (background) everywhere",
            fix="find the objects with `brrp frame SOURCE --segment -o FRAME.npz`, in Python with"
            " segment(frame)",
        )
    return frame


def _refuse_other_sizes(
    shape: tuple[int, int],
    rgb: ArrayLike | None,
    segmap: ArrayLike | None,
    where: Mapping[str, Path | None],
) -> None:
    """FrameError where colour or masks have another size (H, W) than depth. Intrinsics are judged
    by that size, so that they would be blamed."""
    for name, given in (("rgb", rgb), ("segmap", segmap)):
        found = () if given is None else np.shape(given)
        # What has no two axes of pixels is told by its own check.
        image = len(found) == 3 and found[-1] == 3 if name == "rgb" else len(found) == 2
        if image and found[:2] != shape:
            raise FrameError(
                f"{name} has the wrong shape",
                where=where[name],
                expected=f"{(*shape, *found[2:])}: depth has {shape[1]} x {shape[0]} pixels",
                found=f"{found}: {found[1]} x {found[0]} pixels",
                fix=ONE_CAMERA,
            )


def _without_holes(
    points: NDArray[np.float32], K: NDArray[np.float64], source: Path | None
) -> NDArray[np.float32]:
    """Points (H, W, 3) with those of holes that are scattered among them, which the log tells."""
    depth = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    whole = without_scattered_holes(depth, K, ScatteredHolesConfig())
    if whole is depth:
        return points
    hole = np.isnan(depth) & np.isfinite(whole)
    log.info(
        "%s: %s without depth, scattered among others, taken from those beside them",
        source or "The frame",
        counted(int(np.count_nonzero(hole)), "pixel"),
    )
    return np.where(hole[..., None], backproject(whole, K), points).astype(np.float32)


def _told(array: NDArray[Any]) -> str:
    return f"of {array.dtype} with {len(np.unique(array))} values"


def _colour(rgb: ArrayLike, source: Path | None) -> NDArray[np.uint8]:
    colour = np.asarray(rgb)
    if colour.ndim != 3 or colour.shape[-1] != 3:
        raise FrameError(
            "rgb has the wrong shape",
            where=source,
            expected="(H, W, 3)",
            found=f"{colour.shape}, {colour.dtype}",
            fix=advice("rgb", colour),
        )
    if colour.dtype != np.uint8:
        raise FrameError(
            "rgb has the wrong type",
            where=source,
            expected="uint8, 0 to 255",
            found=colour.dtype,
            fix="floats from 0 to 1: (rgb * 255).astype(np.uint8); points: pass them as xyz",
        )
    return colour
