"""One view of the published scene layout: OpenGL depth buffer, matrices and ids."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.files import parse_json, trouble_of
from brrp_cli.frames.arrays import read_npy, read_npz
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.pixels import read_colour

FILES = ("rgb.jpg", "depth.npy", "camera.npz", "seg_mask.npy")
_CAMERA_KEYS = frozenset({"projection_matrix", "view_matrix"})
# OpenGL's camera looks along -z with y up.
_T_GL_CAM = np.diag([1.0, -1.0, -1.0, 1.0])


def read_published(folder: str | Path, *, depth_scale: float | None = None) -> Frame:
    """Read one view folder of a published scene.

    Where the scene's objects.json lies beside the view, ids that it does not list (table, floor)
    are background; without it, negative ids are. `T_world_cam` comes from the view matrix.

    Errors: FrameError.
    """
    folder = Path(folder)
    if depth_scale is not None:
        raise FrameError(
            "A published view has no depth scale",
            where=folder,
            expected="an OpenGL depth buffer, whose unit the camera's matrices tell",
            found=f"--depth-scale {depth_scale:g}",
            fix="leave --depth-scale out",
        )
    rgb, depth, camera, segmentation = (folder / name for name in FILES)
    buffer, ids = read_npy(depth), read_npy(segmentation)
    matrices, keys = read_npz(camera, _CAMERA_KEYS)
    if set(matrices) != _CAMERA_KEYS:
        raise FrameError(
            "The camera lacks a matrix",
            where=camera,
            expected=", ".join(sorted(_CAMERA_KEYS)),
            found=", ".join(keys) or "no arrays",
        )
    projection = _column_vectors(matrices["projection_matrix"], [0, 0, -1, 0], camera)
    view = _column_vectors(matrices["view_matrix"], [0, 0, 0, 1], camera)
    if buffer.ndim != 2 or not np.isfinite(buffer).all() or buffer.min() < 0 or buffer.max() > 1:
        raise FrameError(
            "The depth is no OpenGL depth buffer",
            where=depth,
            expected="(H, W), 0 to 1",
            found=f"shape {buffer.shape}, {buffer.min():g} to {buffer.max():g}",
        )
    return make_frame(
        rgb=read_colour(rgb),
        segmap=_objects_only(ids, folder.parent / "objects.json"),
        depth=depth_from_buffer(buffer, projection),
        K=intrinsics_from_projection(projection, buffer.shape),
        T_world_cam=np.linalg.inv(view) @ _T_GL_CAM,
        source=folder,
    )


def intrinsics_from_projection(
    projection: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    """K (3, 3) of an OpenGL projection matrix (4, 4) on an image of `shape` (H, W).

    Pixel (u, v) has normalised device coordinates (-1 + 2u/W, 1 - 2v/H).
    """
    half_height, half_width = shape[0] / 2, shape[1] / 2
    return np.array(
        [
            [half_width * projection[0, 0], 0, half_width * (1 - projection[0, 2])],
            [0, half_height * projection[1, 1], half_height * (1 + projection[1, 2])],
            [0, 0, 1],
        ]
    )


def depth_from_buffer(
    buffer: NDArray[np.floating], projection: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Depth along z (H, W), metres, of an OpenGL depth buffer; NaN on the far plane (nothing)."""
    ndc = 2 * buffer.astype(np.float64) - 1
    with np.errstate(divide="ignore"):
        depth = projection[2, 3] / (ndc + projection[2, 2])
    return np.where(buffer < 1, depth, np.nan)


def _column_vectors(matrix: NDArray[Any], last_row: list[int], path: Path) -> NDArray[np.float64]:
    """The matrix that acts on column vectors: OpenGL's own memory order is its transpose."""
    if matrix.size == 16 and matrix.dtype.kind in "iuf" and np.isfinite(matrix).all():
        matrix = matrix.reshape(4, 4).astype(np.float64)
        for candidate in (matrix, matrix.T):
            if np.allclose(candidate[3], last_row) and abs(np.linalg.det(candidate)) > 1e-12:
                return candidate
    raise FrameError(
        "The camera's matrix is not OpenGL's",
        where=path,
        expected=f"(4, 4), invertible, last row {last_row}",
        found=np.array2string(matrix, precision=4, separator=", ").replace("\n", ""),
    )


def _objects_only(ids: NDArray[Any], objects: Path) -> NDArray[Any]:
    if not objects.is_file():
        return np.where(ids < 0, BACKGROUND, ids)
    try:
        listed = [int(entry["id"]) for entry in parse_json(objects.read_text(encoding="utf-8"))]
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise FrameError(
            "objects.json cannot be read",
            where=objects,
            expected="a list of {id, mesh_path, position, orientation, scale}",
            found=trouble_of(error),
        ) from error
    if BACKGROUND in listed:
        raise FrameError(
            "An object has the background's id",
            where=f"{objects}: id",
            expected=f"any id but {BACKGROUND}",
            found=BACKGROUND,
        )
    return np.where(np.isin(ids, listed), ids, BACKGROUND)
