"""Whether two frames are the same, told from a few bytes that a record can keep of one."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.frames.frame import Frame


def frame_digest(frame: Frame) -> str:
    """Hex sha256 of all that decides a frame's reconstruction: colours, points, intrinsics, pose,
    masks, those that were left out, and which were corrected; not of where it came from."""
    digest = hashlib.sha256()
    arrays: dict[str, NDArray[Any] | None] = {
        "rgb": frame.rgb,
        "points": frame.points,
        "K": frame.K,
        "T_world_cam": frame.T_world_cam,
        "segmap": frame.segmap,
        "aside": frame.aside,
        "corrected": np.array(sorted(frame.corrected), np.int64),
    }
    for name, array in arrays.items():
        # Name and shape first: the same bytes may be other arrays.
        digest.update(
            f"{name} {None if array is None else (array.dtype.str, array.shape)};".encode()
        )
        if array is not None:
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
