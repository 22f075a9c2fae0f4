"""Intrinsics from the JSON files that people have."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.files import parse_json, read_text, trouble_of
from brrp_cli.frames.arrays import check_file
from brrp_cli.frames.mat import read_meta

log = logging.getLogger(__name__)

_CX = ("cx", "ppx", "x_offset")
_CY = ("cy", "ppy", "y_offset")
_MATRICES = ("K", "k", "cam_K", "camera_matrix")
_OPEN3D = "intrinsic_matrix"
_WIDTHS = ("width", "img_width", "image_width")
_HEIGHTS = ("height", "img_height", "image_height")
_EXPECTED = (
    "fx, fy and cx, cy (or ppx, ppy; or x_offset, y_offset); or a 3 x 3 K; or a ROS camera_info"
)
_EXAMPLE = '{"fx": 615.2, "fy": 615.4, "cx": 320.5, "cy": 240.1}'
_FIX = f"write the camera's own numbers, in pixels, as JSON: {_EXAMPLE}"


@dataclass(frozen=True)
class Intrinsics:
    """K (3, 3), pixels; the (H, W) it is for and its depth_scale, where the file has them.

    depth_scale stands as it was written: its unit differs from one maker of such files to another.
    metres_per_unit : of depth, where the file leaves no doubt (a meta.mat)
    """

    K: NDArray[np.float64]
    shape: tuple[int, int] | None
    depth_scale: float | None
    metres_per_unit: float | None = None


def _number(value: object, key: str, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise FrameError(
            "An intrinsic is no number",
            where=f"{path}: {key}",
            expected="a number",
            found=repr(value),
            fix=f"write a finite number without quotes, as in {_EXAMPLE}",
        )
    return float(value)


def _first(data: dict[str, Any], keys: tuple[str, ...], path: Path) -> float | None:
    return next((_number(data[key], key, path) for key in keys if key in data), None)


def _unwrapped(data: Any) -> Any:
    """What stands under the only key, or under the only key there, unless that key is a matrix."""
    if isinstance(data, dict) and len(data) == 1:
        ((key, value),) = data.items()
        if isinstance(value, dict) and key not in _MATRICES:
            return _unwrapped(value)
    return data


def _matrix(data: dict[str, Any], path: Path) -> NDArray[np.float64] | None:
    key = next((key for key in (*_MATRICES, _OPEN3D) if key in data), None)
    if key is None:
        return None
    value = data[key]
    if isinstance(value, dict):  # OpenCV's and ROS's calibration files wrap the numbers
        value = value.get("data")
    try:
        K = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        K = np.empty(0)
    if K.size != 9:
        raise FrameError(
            "K is no 3 x 3 matrix",
            where=f"{path}: {key}",
            expected="9 numbers",
            found=value,
            fix="write it row by row: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]",
        )
    K = K.reshape(3, 3)
    # Open3D's PinholeCameraIntrinsic writes its matrix column by column.
    return K.T if key == _OPEN3D else K


def read_intrinsics(path: Path) -> Intrinsics:
    """Intrinsics from JSON, or from a meta.mat of GraspNet.

    Understood in JSON: fx, fy with cx, cy, with ppx, ppy (RealSense) or with x_offset, y_offset;
    a 3 x 3 `K`, nested or flat; a ROS camera_info as JSON; BOP's cam_K; Open3D's intrinsic_matrix.
    Any of them may stand under a key such as `color` or `intrinsics` when that is the only one.

    Errors: FrameError if the file is no JSON or lacks them.
    """
    check_file(path)
    if path.suffix == ".mat":
        meta = read_meta(path)
        return Intrinsics(meta.K, None, None, meta.depth_scale)
    try:
        data = parse_json(read_text(path))
    except (ValueError, OSError) as error:
        raise FrameError(
            "The intrinsics are no JSON",
            where=path,
            expected=_EXPECTED,
            found=trouble_of(error),
            fix=_FIX,
        ) from error
    data = _unwrapped(data)
    if isinstance(data, list):
        data = {"K": data}
    if not isinstance(data, dict):
        raise FrameError(
            "The intrinsics are no JSON object",
            where=path,
            expected=_EXPECTED,
            found=data,
            fix=_FIX,
        )
    K = _matrix(data, path)
    if K is None:
        fx, fy = (_first(data, (key,), path) for key in ("fx", "fy"))
        cx, cy = _first(data, _CX, path), _first(data, _CY, path)
        if fx is None or fy is None or cx is None or cy is None:
            raise FrameError(
                "The intrinsics are incomplete",
                where=path,
                expected=_EXPECTED,
                found=", ".join(data) or "no keys",
                fix=_FIX,
            )
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    for key in ("D", "d", "coeffs", "distortion", "distortion_coefficients"):
        if isinstance(data.get(key), list) and any(data[key]):
            log.warning("%s: lens distortion (%s) is not applied: rectify the images", path, key)
    width, height = _first(data, _WIDTHS, path), _first(data, _HEIGHTS, path)
    return Intrinsics(
        K=K,
        shape=None if width is None or height is None else (int(height), int(width)),
        depth_scale=_first(data, ("depth_scale",), path),
    )
