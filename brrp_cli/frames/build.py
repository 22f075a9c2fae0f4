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
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.misplaced import advice, swapped
from brrp_cli.geometry import backproject
from brrp_cli.spoken import option

log = logging.getLogger(__name__)

MAX_PIXELS = 2**24
FARTHEST_MEDIAN = 20.0  # metres; nobody reconstructs a table from further away
NEAREST_MEDIAN = 0.01
# Cameras measure from about 0.1 m, and tables stand within a few: beyond, the unit is suspect.
USUAL_MEDIAN = 0.15, 4.0
FARTHEST = 100.0  # metres; single values beyond it are a sensor's or a format's, not a place
MAX_OBJECTS = 1000
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
) -> Frame:
    """Check one camera's arrays and make a frame of them. The arrays are copied, never changed.

    All arguments go by name, and an array under another's name is told: colour and depth that are
    swapped would make a frame of nothing.

    Parameters
    ----------
    rgb : (H, W, 3) uint8; None = grey
    segmap : (H, W) integers (or floats that hold integers), 0 = background, any other id is an
        object; None = no masks yet (for `segment`)
    depth : (H, W), along z. Floats are metres, integers millimetres, unless `depth_scale` is
        given; 0, NaN and inf = no return
    K : (3, 3) pinhole intrinsics, pixels; needed with `depth`, fitted where `xyz` comes without
    xyz : (H, W, 3) points instead of `depth`, metres, camera frame (x right, y down, z forward)
    T_world_cam : (4, 4) rigid transform, camera frame to world frame
    depth_scale : raw value x depth_scale = metres
    source : file or folder, for messages
    files : the file of single arrays, for messages, where they have one each: array's name -> path

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
                "Depth without intrinsics", where=source, expected="K, (3, 3)", found="no K"
            )
        z = _depth_metres(np.asarray(depth), depth_scale, where["depth"])
        height, width = z.shape
        K_checked = check_intrinsics(np.asarray(K), (height, width), where["K"])
        points = backproject(z, K_checked)
    elif xyz is not None:
        points = _points_metres(np.asarray(xyz), depth_scale, source)
        height, width = points.shape[:2]
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
        segmap=nowhere if segmap is None else _masks(segmap, where["segmap"]),
        K=K_checked,
        T_world_cam=None if T_world_cam is None else check_pose(np.asarray(T_world_cam), source),
        source=source,
    )


def require_objects(frame: Frame) -> Frame:
    """The frame itself. Errors: FrameError if its mask has no object."""
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
    return _scaled(raw, raw, "depth", scale, source)


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
            "The depth scale is no positive number", where=source, found=scale, expected="> 0"
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
            fix=f"say what one unit is: {option('depth_scale', 0.001)} for millimetres, 0.0002 for"
            " TUM's 5000 to the metre",
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
            found="NaN or inf everywhere" if not np.isfinite(raw_z).any() else "0, NaN or inf only",
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


def _masks(segmap: ArrayLike, source: Path | None) -> NDArray[np.int64]:
    ids = np.asarray(segmap)
    if ids.ndim == 3 and ids.shape[-1] == 1:
        ids = ids[..., 0]
    whole = ids.dtype.kind in "iub" or (
        ids.dtype.kind == "f" and bool(np.isfinite(ids).all() and (ids == np.floor(ids)).all())
    )
    if ids.ndim != 2 or not whole or (ids.size and np.abs(ids.astype(np.float64)).max() >= 2**62):
        raise FrameError(
            "segmap is no map of object ids",
            where=source,
            expected="(H, W) whole numbers, 0 = background",
            found=f"shape {ids.shape}, dtype {ids.dtype}",
            fix=advice("segmap", ids),
        )
    ids = ids.astype(np.int64)
    objects = len(np.unique(ids))
    if objects > MAX_OBJECTS:
        raise FrameError(
            "segmap holds too many objects",
            where=source,
            expected=f"at most {MAX_OBJECTS} different ids",
            found=f"{objects}",
            fix="check that it is the map of object ids, and not depth or colour",
        )
    return ids
