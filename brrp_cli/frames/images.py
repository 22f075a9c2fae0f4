"""A frame from colour and depth images with an intrinsics file."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.intrinsics import Intrinsics, read_intrinsics
from brrp_cli.frames.masks import check_masks
from brrp_cli.frames.pixels import read_colour, read_depth, read_masks
from brrp_cli.spoken import option

log = logging.getLogger(__name__)

# What makers of intrinsics files write for millimetres: metres (RealSense), millimetres (BOP),
# units to the metre.
_MILLIMETRES = (0.001, 1.0, 1000.0)


def read_images(
    color: str | Path,
    depth: str | Path,
    intrinsics: str | Path,
    masks: str | Path | None = None,
    *,
    depth_scale: float | None = None,
) -> Frame:
    """Read images of one camera at one resolution, the depth aligned to the colour.

    color : PNG or JPEG; depth : 16-bit PNG, TIFF or .npy (integers are millimetres and floats
    metres unless `depth_scale` is given); intrinsics : JSON, see `read_intrinsics`; masks : image
    or .npy of object ids, None = no masks yet.

    Errors: FrameError, also where the sizes disagree.
    """
    said = depth_scale is not None
    color, depth, intrinsics = Path(color), Path(depth), Path(intrinsics)
    camera = read_intrinsics(intrinsics)
    rgb, raw = read_colour(color), read_depth(depth)
    shape = rgb.shape[:2]
    _same_size(shape, raw.shape[:2], depth)
    ids = None if masks is None else _own_masks(Path(masks), shape)
    if camera.shape is not None:
        _same_size(shape, camera.shape, intrinsics)
    if depth_scale is None and raw.dtype.kind in "iu":
        depth_scale = camera.metres_per_unit
        if depth_scale is None:
            _millimetres(camera, intrinsics)
    frame = make_frame(
        rgb=rgb,
        segmap=ids,
        depth=raw,
        K=camera.K,
        depth_scale=depth_scale,
        source=depth,
        files={"rgb": color, "K": intrinsics} | ({} if masks is None else {"segmap": Path(masks)}),
    )
    unit = "millimetres" if raw.dtype.kind in "iu" else "metres"
    log.info(
        "Depth: %s, taken as %s (median %.2f m)%s",
        raw.dtype,
        unit if depth_scale is None else f"units of {depth_scale:g} m",
        float(np.median(frame.depth[frame.valid])),
        "" if said else f"; {option('depth_scale')} says otherwise",
    )
    return frame


def given_masks(path: Path, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """(H, W) object ids of a file, for a frame of that shape that was read without them. Errors:
    FrameError, also where the sizes disagree."""
    return check_masks(_own_masks(path, shape), path)


def _own_masks(path: Path, shape: tuple[int, ...]) -> NDArray[Any]:
    ids = read_masks(path)
    _same_size(shape, ids.shape[:2], path)
    if not np.any(ids):
        raise FrameError(
            "There is no object in the mask",
            where=path,
            expected="at least one pixel that is not 0",
            found="0 (background) everywhere",
            fix="leave it out, and masks are made from depth",
        )
    return ids


def _same_size(color: tuple[int, ...], other: tuple[int, ...], path: Path) -> None:
    if color != other:
        raise FrameError(
            "The sizes disagree",
            where=path,
            expected=f"{color[1]} x {color[0]} (width x height), the colour image's size",
            found=f"{other[1]} x {other[0]}" if len(other) == 2 else other,
            fix="align depth and masks to the colour camera, and take that camera's intrinsics",
        )


def _millimetres(camera: Intrinsics, path: Path) -> None:
    if camera.depth_scale is not None and camera.depth_scale not in _MILLIMETRES:
        raise FrameError(
            "The intrinsics hold a depth_scale whose unit they do not tell",
            where=path,
            expected=f"{option('depth_scale')}: how many metres one unit of depth is",
            found=f"depth_scale {camera.depth_scale:g}",
            fix=f"{option('depth_scale', f'{camera.depth_scale:g}')} if it is in metres"
            f" (RealSense), {option('depth_scale', f'{camera.depth_scale / 1000:g}')} if it is in"
            " millimetres (BOP)",
        )
