"""The camera's pose from a file: T_world_cam as JSON, .npy or text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.files import parse_json, read_text, trouble_of
from brrp_cli.frames.arrays import check_file, read_npy
from brrp_cli.frames.camera import check_pose

KEYS = ("T_world_cam", "camera_pose", "pose")
_MOST_BYTES = 2**16
_EXPECTED = "T_world_cam, 4 x 4 or 16 numbers row by row: the camera's axes and place in the world"
_FIX = (
    "write [R t; 0 0 0 1] row by row: R is the rotation (from a quaternion, in Python, by"
    " scipy's Rotation.from_quat([x, y, z, w]).as_matrix()), t the camera's place in metres"
)


def read_pose(path: Path) -> NDArray[np.float64]:
    """T_world_cam (4, 4), metres, of a JSON file (the matrix, or one under a key of `KEYS`), an
    .npy file, or text with 16 numbers. Errors: FrameError, also where it is not rigid."""
    check_file(path)
    if path.suffix == ".npy":
        value: Any = read_npy(path)
    else:
        value = _written(path)
    try:
        T = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        T = np.empty(0)
    if T.size != 16:
        raise FrameError(
            "The camera's pose is no 4 x 4 matrix",
            where=path,
            expected=_EXPECTED,
            found=value,
            fix=_FIX,
        )
    return check_pose(T.reshape(4, 4), path)


def _written(path: Path) -> Any:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ValueError(f"more than {_MOST_BYTES} bytes")
        text = read_text(path)
        if path.suffix != ".json":
            return [float(word) for word in text.replace(",", " ").split()]
        value = parse_json(text)
    except (OSError, ValueError) as error:
        raise FrameError(
            "The camera's pose cannot be read",
            where=path,
            expected=_EXPECTED,
            found=trouble_of(error),
            fix=_FIX,
        ) from error
    if isinstance(value, dict):
        key = next((key for key in KEYS if key in value), None)
        if key is None:
            raise FrameError(
                "The file holds no pose of the camera",
                where=path,
                expected=f"one of the keys {', '.join(KEYS)}",
                found=", ".join(value) or "no keys",
                fix=f"name the matrix {KEYS[0]}",
            )
        return value[key]
    return value
