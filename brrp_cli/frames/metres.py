"""Depth or points of any unit to metres: what a unit is taken for is told, and never guessed in
silence."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.misplaced import advice
from brrp_cli.spoken import counted, option

log = logging.getLogger(__name__)

MAX_PIXELS = 2**24
FARTHEST_MEDIAN = 20.0  # metres; nobody reconstructs a table from further away
NEAREST_MEDIAN = 0.01
# Cameras measure from about 0.1 m, and tables stand within a few: beyond, the unit is suspect.
USUAL_MEDIAN = 0.15, 4.0
FARTHEST = 100.0  # metres; single values beyond it are a sensor's or a format's, not a place


def depth_metres(raw: NDArray[Any], scale: float | None, source: Path | None) -> NDArray[Any]:
    """Raw depth (H, W) or (H, W, 1) to (H, W) float32, metres; 0 or NaN = no return.

    scale : metres in one unit; None = integers are millimetres, floats metres
    Errors: FrameError for what is no depth, holds none, or seems to be in another unit.
    """
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


def points_metres(raw: NDArray[Any], scale: float | None, source: Path | None) -> NDArray[Any]:
    """The same for points (H, W, 3); NaN = no return."""
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
