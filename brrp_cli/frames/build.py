"""Arrays of any source to a checked `Frame`: the one place where a frame's checks stand."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.camera import check_intrinsics, check_pose, fit_intrinsics
from brrp_cli.frames.frame import ONE_CAMERA, Frame
from brrp_cli.frames.masks import MAX_OBJECTS, check_masks
from brrp_cli.frames.misplaced import advice, swapped
from brrp_cli.geometry import backproject
from brrp_cli.spoken import counted, option

log = logging.getLogger(__name__)

MAX_PIXELS = 2**24
FARTHEST_MEDIAN = 20.0  # metres; nobody reconstructs a table from further away
NEAREST_MEDIAN = 0.01
# Cameras measure from about 0.1 m, and tables stand within a few: beyond, the unit is suspect.
USUAL_MEDIAN = 0.15, 4.0
FARTHEST = 100.0  # metres; single values beyond it are a sensor's or a format's, not a place
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
        z = _depth_metres(np.asarray(depth), depth_scale, where["depth"])
        height, width = z.shape
        if np.shape(K) == (3, 3):  # else depth and K may be swapped, which K's own check tells
            _refuse_other_sizes((height, width), rgb, segmap, where)
        K_checked = check_intrinsics(np.asarray(K), (height, width), where["K"])
        points = backproject(z, K_checked)
    elif xyz is not None:
        points = _points_metres(np.asarray(xyz), depth_scale, source)
        height, width = points.shape[:2]
        _refuse_other_sizes((height, width), rgb, segmap, where)
        given = None if K is None else check_intrinsics(np.asarray(K), (height, width), source)
        K_checked = fit_intrinsics(points, given, source)
    else:
        raise FrameError(
            "Neither depth nor points", where=source, expected="depth and K, or xyz", found="none"
        )
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


def _told(array: NDArray[Any]) -> str:
    return f"of {array.dtype} with {len(np.unique(array))} values"


def _numbers(array: NDArray[Any], name: str, source: Path | None) -> None:
    if array.dtype.kind not in "iuf":
        raise FrameError(
            f"{name} does not hold real numbers",
            where=source,
            expected="integers or floats",
            found=f"dtype {array.dtype}",
        )
    pixels = int(np.prod(array.shape[:2]))
    if not 0 < pixels <= MAX_PIXELS:
        raise FrameError(
            f"{name} is empty" if pixels == 0 else f"{name} is too large",
            where=source,
            expected=f"1 to {MAX_PIXELS} pixels",
            found=f"shape {array.shape}",
        )


def _depth_metres(raw: NDArray[Any], scale: float | None, source: Path | None) -> NDArray[Any]:
    if raw.ndim == 3 and raw.shape[-1] == 1:
        raw = raw[..., 0]
    if raw.ndim != 2:
        raise FrameError(
            "depth has the wrong shape",
            where=source,
            expected="(H, W)",
            found=f"{raw.shape}, {raw.dtype}",
            fix=advice("depth", raw),
        )
    if scale is None and raw.dtype in (np.uint8, np.bool_):
        raise FrameError(
            "depth has one byte a pixel, which is too coarse for depth",
            where=source,
            expected="floats in metres, or 16-bit integers in millimetres",
            found=f"{raw.dtype}, {raw.min()} to {raw.max()}" if raw.size else raw.dtype,
            fix=f"if these are masks, pass them as segmap; else say the unit with"
            f" {option('depth_scale')}",
        )
    _numbers(raw, "depth", source)
    raw = _without_largest(raw, source)
    return _scaled(raw, raw, "depth", scale, source)


def _without_largest(raw: NDArray[Any], source: Path | None) -> NDArray[Any]:
    """Depth with 0 for the largest number of an unsigned type, which sensors and programs write
    where there is no return: 65535 would be a wall at 65 m. In a wider type it is that of the 16
    bits which it came from, if nothing is larger."""
    if raw.dtype.kind not in "iu":
        return raw
    kind = raw.dtype
    if kind.itemsize > 2 and raw.max() == np.iinfo(np.uint16).max:
        kind = np.dtype(np.uint16)
    largest = np.iinfo(kind).max
    nothing = raw == largest
    if kind.kind != "u" or not nothing.any():
        return raw
    log.info(
        "%s: %s with %d, the largest number of %s: no return",
        source or "The frame",
        counted(int(nothing.sum()), "pixel"),
        largest,
        kind,
    )
    return np.where(nothing, raw.dtype.type(0), raw)


def _points_metres(raw: NDArray[Any], scale: float | None, source: Path | None) -> NDArray[Any]:
    if raw.ndim != 3 or raw.shape[-1] != 3:
        raise FrameError(
            "xyz has the wrong shape",
            where=source,
            expected="(H, W, 3)",
            found=f"{raw.shape}, {raw.dtype}",
            fix=advice("xyz", raw),
        )
    _numbers(raw, "xyz", source)
    points = _scaled(raw, raw[..., 2], "xyz", scale, source)
    points[~(np.isfinite(points).all(axis=-1) & (points[..., 2] > 0))] = np.nan
    if not np.isfinite(points).any():
        raise FrameError(
            "xyz has no valid pixel",
            where=source,
            expected="some points with x, y and z",
            found="NaN or inf in each of them",
        )
    return points


def _scaled(
    raw: NDArray[Any], raw_z: NDArray[Any], name: str, scale: float | None, source: Path | None
) -> NDArray[np.float32]:
    """`raw` in metres, float32, once its z has been found to be depth."""
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise FrameError(
            "The depth scale is no positive number",
            where=source,
            expected="> 0",
            found=scale,
            fix=_unit_fix(),
        )
    valid = _measured(raw_z, name, source)
    if scale is not None:
        factor, unit = scale, "x depth scale"
    elif raw.dtype.kind in "iu":
        factor, unit = 0.001, "as millimetres"
    else:
        factor, unit = 1.0, "as metres"
    median = float(np.median(raw_z[valid])) * factor
    if not NEAREST_MEDIAN <= median <= FARTHEST_MEDIAN:
        raise FrameError(
            f"{name} seems to be in another unit",
            where=source,
            expected=f"a median depth of {NEAREST_MEDIAN} to {FARTHEST_MEDIAN:g} m",
            found=f"median {median:.6g} m ({raw.dtype}, {unit})",
            fix=_unit_fix(),
        )
    if not USUAL_MEDIAN[0] <= median <= USUAL_MEDIAN[1]:
        log.warning(
            "%s: the median depth is %.3g m (%s, %s), which is unusual for a table: suspect the"
            " unit, and say what one unit of depth is with %s",
            source or "The frame",
            median,
            raw.dtype,
            unit,
            option("depth_scale"),
        )
    with np.errstate(over="ignore", invalid="ignore"):
        metres = (raw.astype(np.float64) * factor).astype(np.float32)
        beyond = np.asarray(np.abs(metres).reshape(*raw_z.shape, -1) > FARTHEST).any(axis=-1)
    if (beyond & valid).any():
        log.warning(
            "%s: %d pixels lie beyond %g m and count as no return",
            source or "The frame",
            np.count_nonzero(beyond & valid),
            FARTHEST,
        )
    metres[beyond] = np.nan
    return metres


def _unit_fix() -> str:
    return (
        f"say what one unit is: {option('depth_scale', 0.001)} for millimetres, 0.0002 for TUM's"
        " 5000 to the metre"
    )


def _measured(raw_z: NDArray[Any], name: str, source: Path | None) -> NDArray[np.bool_]:
    """(H, W) where there is a return. Errors: FrameError for negative depth, and for none."""
    valid: NDArray[np.bool_] = np.isfinite(raw_z) & (raw_z != 0)
    if (raw_z[valid] < 0).any():
        raise FrameError(
            f"{name} holds negative depth",
            where=source,
            expected="depth along z, forward; 0 or NaN where there is no return",
            found=f"{int((raw_z[valid] < 0).sum())} negative values, smallest {raw_z[valid].min()}",
            fix="turn OpenGL's z (backward) round; set pixels without a return to 0",
        )
    if not valid.any():
        raise FrameError(
            f"{name} has no valid pixel",
            where=source,
            expected="some depth above 0",
            found="NaN or inf everywhere"
            if not np.isfinite(raw_z).any()
            else "no return (0, NaN, inf, or the largest number of an unsigned type) everywhere",
            fix="check that the depth image is the right file and that the sensor ran",
        )
    return valid


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
