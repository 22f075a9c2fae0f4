"""Checks of a camera's intrinsics and pose, and intrinsics fitted to organised points."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.errors import FrameError
from brrp_cli.frames.misplaced import advice

log = logging.getLogger(__name__)

# Above these medians points are no pinhole image: pixels, and a share of the image's larger side,
# without which any cloud would pass for a tiny image.
MAX_RESIDUAL = 2.0
_MAX_SHARE = 0.02
# Focal lengths, as shares of the image's size, of a fish-eye and of a telescope.
_FOCAL = 0.05, 1000.0
# A principal point that lies beyond the middle by one factor in both directions, this large and
# with this tolerance, is that of a larger image, of which this one is a smaller copy.
_LARGER, _ALIKE = 1.4, 0.05
# Metres from the camera to the world's origin above which the unit of a pose is suspect.
_FAR = 50.0
_CALIBRATED = "take K of the camera's calibration for images of this size, in pixels"
_EXPECTED_K = "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]], pixels, fx and fy > 0"


def check_intrinsics(
    K: NDArray[Any], shape: tuple[int, int], source: Path | None
) -> NDArray[np.float64]:
    """`K` (3, 3) as float64. Errors: FrameError if it is no pinhole matrix of an (H, W) image."""

    def refuse(what: str, fix: str = _CALIBRATED) -> FrameError:
        found = np.array2string(K, separator=", ").replace("\n", "")
        return FrameError(what, where=source, expected=_EXPECTED_K, found=found, fix=fix)

    if K.shape != (3, 3):
        raise FrameError(
            "K has the wrong shape",
            where=source,
            expected=(3, 3),
            found=K.shape,
            fix=advice("K", K) or _CALIBRATED,
        )
    if K.dtype.kind not in "iuf" or not np.isfinite(K).all():
        raise refuse("K does not hold finite numbers")
    K = K.astype(np.float64)
    if (K[2, :2] != 0).any() and (K[:2, 2] == 0).all() and K[2, 2] == 1:
        raise refuse("K is transposed", "pass K.T")
    if K[0, 0] <= 0 or K[1, 1] <= 0:
        raise refuse(
            "K has a focal length that is not positive",
            "write fx and fy above 0; a sign that turns an axis, as in OpenGL, is left out",
        )
    # Back-projection knows no skew, and skew is 0 in every camera that people use here.
    if not np.array_equal(K[2], [0, 0, 1]) or K[1, 0] != 0 or abs(K[0, 1]) > 1e-3 * K[0, 0]:
        raise refuse("K is no pinhole matrix without skew")
    height, width = shape
    focal = K[0, 0] / width, K[1, 1] / height
    if min(focal) < _FOCAL[0]:
        raise refuse("K is not in pixels", "multiply normalised intrinsics by the image's size")
    if max(focal) > _FOCAL[1] or max(abs(K[0, 2]) / width, abs(K[1, 2]) / height) > _FOCAL[1]:
        raise refuse("K is of no camera that sees this image")
    beyond = K[0, 2] / (width / 2), K[1, 2] / (height / 2)
    if min(beyond) > _LARGER and abs(beyond[0] / beyond[1] - 1) < _ALIKE:
        factor = sum(beyond) / 2
        raise FrameError(
            "The intrinsics are of a larger image",
            where=source,
            expected=f"a principal point near the middle of {width} x {height} pixels",
            found=f"({K[0, 2]:.1f}, {K[1, 2]:.1f}), the middle of about "
            f"{2 * K[0, 2]:.0f} x {2 * K[1, 2]:.0f}",
            fix=f"take the intrinsics of this resolution, or divide fx, fy, cx and cy by"
            f" {factor:.3g}",
        )
    if not (0 <= K[0, 2] <= width and 0 <= K[1, 2] <= height):
        log.warning(
            "The principal point (%.1f, %.1f) lies outside the %d x %d image: is K of another"
            " resolution or crop?",
            K[0, 2],
            K[1, 2],
            width,
            height,
        )
    if 0 < max(beyond) < 1 / _LARGER and abs(beyond[0] - beyond[1]) < _ALIKE * max(beyond):
        log.warning(
            "The principal point (%.1f, %.1f) is the middle of about %.0f x %.0f pixels, not of"
            " %d x %d: if K is of a smaller image, objects come out too large",
            K[0, 2],
            K[1, 2],
            2 * K[0, 2],
            2 * K[1, 2],
            width,
            height,
        )
    return K


def _written(matrix: NDArray[Any]) -> str:
    return np.array2string(matrix, separator=", ", precision=4).replace("\n", "")


def _is_rigid(T: NDArray[Any]) -> bool:
    """Whether it is, but for its handedness."""
    return (
        T.shape == (4, 4)
        and T.dtype.kind in "iuf"
        and bool(np.isfinite(T).all())
        and np.allclose(T[3], [0, 0, 0, 1], atol=1e-6)
        and np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-3)
    )


def check_pose(T: NDArray[Any], source: Path | None) -> NDArray[np.float64]:
    """`T_world_cam` (4, 4) as float64. Errors: FrameError if it is no rigid transform."""
    if not _is_rigid(T):
        raise FrameError(
            "T_world_cam is no rigid transform",
            where=source,
            expected="(4, 4): rotation, translation in metres, last row 0 0 0 1",
            found=_written(T),
            fix="transpose it: it was written column by column"
            if _is_rigid(T.T)
            else advice("T_world_cam", T)
            or "take a rotation without scale, such as of a quaternion of length 1",
        )
    if np.linalg.det(T[:3, :3]) < 0:
        raise FrameError(
            "T_world_cam is no rigid transform: it mirrors, so it is left-handed",
            where=source,
            expected="a rotation with determinant 1; the camera's x right, y down, z forward",
            found=f"determinant -1 of {_written(T[:3, :3])}",
            fix="negate the axis that points the wrong way, in the camera or in the world; or take"
            " the pose in a right-handed world (Unity's is left-handed)",
        )
    away = float(np.linalg.norm(T[:3, 3]))
    if away > _FAR:
        log.warning(
            "T_world_cam: the camera stands %.4g m from the world's origin, which is far for a"
            " table: suspect the unit, which is metres",
            away,
        )
    return T.astype(np.float64)


def _residual(ratio: NDArray[Any], pixel: NDArray[Any], f: float, c: float) -> float:
    return float(np.median(np.abs(f * ratio + c - pixel)))


def fit_intrinsics(
    points: NDArray[np.floating], given: NDArray[np.float64] | None, source: Path | None
) -> NDArray[np.float64]:
    """Pinhole intrinsics (3, 3) of organised points (H, W, 3), camera frame, NaN = no return.

    Least squares on u = fx x/z + cx and v = fy y/z + cy; a `given` K is checked in place of that.

    Errors: FrameError if the points are no pinhole image.
    """
    height, width = points.shape[:2]
    valid = np.isfinite(points).all(axis=-1)
    v, u = np.nonzero(valid)
    seen = points[valid].astype(np.float64)
    K = np.eye(3)
    residuals = []
    for axis, pixel in enumerate((u, v)):
        with np.errstate(over="ignore"):
            ratio = seen[:, axis] / seen[:, 2]
        if given is not None:
            f, c = given[axis, axis], given[axis, 2]
        elif np.ptp(pixel) < 2 or not 0 < np.ptp(ratio) < np.inf:
            f, c = np.nan, np.nan
        else:
            f, c = np.polyfit(ratio, pixel, 1)
        K[axis, axis], K[axis, 2] = f, c
        residuals.append(_residual(ratio, pixel, f, c))
    if not (
        max(residuals) <= min(MAX_RESIDUAL, _MAX_SHARE * max(height, width))
        and K[0, 0] > 0
        and K[1, 1] > 0
    ):
        raise FrameError(
            "xyz is no pinhole camera's image",
            where=source,
            expected="organised points in the camera frame: x right, y down, z forward",
            found=f"fx = {K[0, 0]:.4g}, fy = {K[1, 1]:.4g}, median error"
            f" {max(residuals):.3g} pixels",
            fix="transform the points to the camera frame, or pass depth and K",
        )
    # A given K has been checked, and its warning is out.
    return K if given is not None else check_intrinsics(K, (height, width), source)
