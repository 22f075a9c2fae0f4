"""Frame files: .npz with contact_graspnet's keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.files import atomic_path
from brrp_cli.frames.arrays import read_npz
from brrp_cli.frames.build import make_frame, require_objects
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject

ACCEPTED = frozenset(
    {"rgb", "depth", "K", "xyz", "segmap", "seg", "T_world_cam", "left_out", "corrected"}
)
_NEEDED = "depth and K, or xyz; segmap or seg; optional: rgb, T_world_cam, left_out, corrected"


def load_frame(
    path: str | Path,
    *,
    depth_scale: float | None = None,
    masks: bool = True,
    background_told: bool = False,
) -> Frame:
    """Read a frame file.

    Keys: `depth` (H, W) and `K` (3, 3), or `xyz` (H, W, 3); `segmap` or `seg` (H, W); `rgb`
    (H, W, 3) uint8 and `T_world_cam` (4, 4) where known; `left_out` (H, W) for `Frame.aside`, and
    `corrected` (n,) for `Frame.corrected`. Units and checks as in `make_frame`. Pickles are never
    loaded.

    depth_scale : raw depth x depth_scale = metres
    masks : whether the file must have masks with an object in them
    background_told : as in `make_frame`

    Errors: FrameError if the file is missing, damaged, too large, lacks a key or fails a check.
    """
    path = Path(path)
    arrays, keys = read_npz(path, ACCEPTED)
    has_depth = "depth" in arrays and "K" in arrays
    has_masks = "segmap" in arrays or "seg" in arrays
    if not (has_depth or "xyz" in arrays) or (masks and not has_masks):
        lacking = [] if has_depth or "xyz" in arrays else ["depth and K, or xyz"]
        if masks and not has_masks:
            lacking.append("segmap")
        raise FrameError(
            f"The frame lacks {'; '.join(lacking)}",
            where=path,
            expected=_NEEDED,
            found=", ".join(keys) or "no arrays",
            fix="save the arrays under these names"
            + ("" if has_masks else ", or find the objects with `brrp frame --segment`"),
        )
    K = arrays.get("K")
    if K is not None and K.shape == (9,):  # contact_graspnet takes it flat too
        K = K.reshape(3, 3)
    frame = make_frame(
        rgb=arrays.get("rgb"),
        segmap=arrays.get("segmap", arrays.get("seg")),
        depth=arrays["depth"] if has_depth else None,
        K=K,
        xyz=None if has_depth else arrays["xyz"],
        T_world_cam=arrays.get("T_world_cam"),
        depth_scale=depth_scale,
        source=path,
        background_told=background_told,
    )
    if "left_out" in arrays and has_masks:
        corrected = _corrected(arrays.get("corrected"), frame)
        frame = frame.with_masks(frame.segmap, _left_out(arrays["left_out"], frame), corrected)
    return require_objects(frame) if masks else frame


def _left_out(masks: NDArray[Any], frame: Frame) -> NDArray[np.integer]:
    """Errors: FrameError if `left_out` is none of the frame."""
    if masks.shape != frame.shape or not np.issubdtype(masks.dtype, np.integer):
        raise FrameError(
            "The frame's left_out holds no masks",
            where=frame.source,
            expected=f"integers, {frame.shape}",
            found=f"{masks.dtype}, {masks.shape}",
            fix="leave it out, or make the masks again: `brrp segment FRAME.npz --again`",
        )
    return masks


def _corrected(ids: NDArray[Any] | None, frame: Frame) -> frozenset[int]:
    """Errors: FrameError if they are no ids."""
    if ids is None:
        return frozenset()
    if ids.ndim != 1 or not np.issubdtype(ids.dtype, np.integer):
        raise FrameError(
            "The frame's corrected holds no ids",
            where=frame.source,
            expected="integers, (n,)",
            found=f"{ids.dtype}, {ids.shape}",
            fix="leave it out, or make the masks again: `brrp segment FRAME.npz --again`",
        )
    return frozenset(int(i) for i in ids) & frozenset(frame.object_ids)


def save_frame(frame: Frame, path: str | Path) -> None:
    """Write a frame file that `load_frame` reads back to the same arrays.

    Points that are exactly K's back-projected depth are written as `depth`, others as `xyz`.

    Errors: OutputError if the file cannot be written.
    """
    arrays = {"rgb": frame.rgb, "segmap": frame.segmap, "K": frame.K}
    depth = frame.points[..., 2]
    if np.array_equal(backproject(depth, frame.K), frame.points, equal_nan=True):
        arrays["depth"] = depth
    else:
        arrays["xyz"] = frame.points
    if frame.T_world_cam is not None:
        arrays["T_world_cam"] = frame.T_world_cam
    if frame.aside is not None:
        arrays["left_out"] = frame.aside
    if frame.corrected:
        arrays["corrected"] = np.array(sorted(frame.corrected))
    with atomic_path(Path(path)) as partial, partial.open("wb") as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
