"""From a rectified infrared pair to depth, as an active stereo camera's processor does it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.depth_noise.align import align_depth
from brrp_cli.depth_noise.millimetres import whole_millimetres
from tabletop.active_stereo import BASELINE, COLOUR_TO_LEFT, InfraredPair, infrared_pair
from tabletop.stage import Stage

NEAREST = 0.28  # metres: sets the range of disparities that is searched
BLOCK = 7  # pixels: side of the window that is matched
# Penalties of neighbours one step and more apart, per pixel of a window. OpenCV's usual 8 and 32
# make terraces of a tilted table.
SMALL_STEP, LARGE_STEP = 2, 16
UNIQUENESS = 10  # per cent by which the best match has to beat the second
LEFT_RIGHT = 1  # pixels by which matching from the right may differ
CONTRAST = 3.5  # grey levels: standard deviation within a window that can be matched
SPECKLE_PIXELS, SPECKLE_RANGE = 120, 2
SUBPIXEL = 32  # steps of disparity a pixel that the camera reports; OpenCV's matcher has 16
MEDIAN = 5  # pixels
# librealsense's spatial filter: weight of a pixel's own value, jump of disparity that stops it.
FILTER_ALPHA, FILTER_DELTA, FILTER_PASSES = 0.3, 1.2, 2


def stereo_depth(stage: Stage, rng: np.random.Generator) -> NDArray[np.float64]:
    """Depth (H, W), metres, whole millimetres, in the colour view; 0 = no return."""
    pair = infrared_pair(stage, rng)
    found = smooth_disparity(match(pair, float(stage.K[0, 0])))
    steps = np.rint(found * SUBPIXEL)
    depth = np.where(steps > 0, stage.K[0, 0] * BASELINE * SUBPIXEL / np.maximum(steps, 1), 0.0)
    aligned = align_depth(depth, stage.K, COLOUR_TO_LEFT, stage.K, stage.shape)
    return whole_millimetres(aligned)


def match(pair: InfraredPair, focal: float) -> NDArray[np.float64]:
    """Disparity (H, W), pixels, 0 = none, by OpenCV's semi-global matching (Hirschmueller, PAMI
    2008) with sub-pixel steps, left-right check, uniqueness and speckle filter.
    """
    cv2: Any = import_library("cv2")
    cv2.setNumThreads(1)  # the same bytes whatever the machine
    count = 16 * int(np.ceil(focal * BASELINE / NEAREST / 16))
    matcher = cv2.StereoSGBM_create(
        minDisparity=0,
        numDisparities=count,
        blockSize=BLOCK,
        P1=SMALL_STEP * BLOCK**2,
        P2=LARGE_STEP * BLOCK**2,
        disp12MaxDiff=LEFT_RIGHT,
        preFilterCap=31,
        uniquenessRatio=UNIQUENESS,
        speckleWindowSize=SPECKLE_PIXELS,
        speckleRange=SPECKLE_RANGE,
        mode=cv2.STEREO_SGBM_MODE_SGBM,
    )
    # OpenCV gives up on the leftmost `count` columns. A camera loses only those whose match lies
    # beyond the right image's border.
    left, right = (np.pad(image, ((0, 0), (count, 0))) for image in (pair.left, pair.right))
    disparity = matcher.compute(left, right)[:, count:].astype(np.float64) / 16
    outside = disparity > np.arange(disparity.shape[1])
    missing = (disparity <= 0) | outside | (_contrast(pair.left) < CONTRAST)
    return np.where(missing, 0.0, disparity)


def _contrast(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Standard deviation of an image (H, W) in each matching window."""
    cv2: Any = import_library("cv2")
    grey = image.astype(np.float64)
    size = (BLOCK, BLOCK)
    return np.sqrt(np.maximum(cv2.blur(grey**2, size) - cv2.blur(grey, size) ** 2, 0.0))


def smooth_disparity(disparity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Disparity (H, W), 0 = none, through a median and librealsense's spatial filter.

    The latter is recursive, along rows and columns, forth and back, and stops at edges (Gastal &
    Oliveira, "Domain transform", SIGGRAPH 2011).
    """
    cv2: Any = import_library("cv2")
    smooth = cv2.medianBlur(disparity.astype(np.float32), MEDIAN).astype(np.float64)
    smooth[disparity == 0] = 0.0
    for _ in range(FILTER_PASSES):
        for lines in (smooth.T, smooth.T[::-1], smooth, smooth[::-1]):
            _recursive(lines)
    return smooth


def _recursive(lines: NDArray[np.float64]) -> None:
    """One pass, in place, from the first row of `lines` to the last."""
    before = lines[0].copy()
    for row in lines[1:]:
        joined = (row > 0) & (before > 0) & (np.abs(row - before) < FILTER_DELTA)
        row[:] = np.where(joined, FILTER_ALPHA * row + (1 - FILTER_ALPHA) * before, row)
        before = row
