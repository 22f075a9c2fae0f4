"""What a structured-light camera makes of a clean depth image.

Four effects, in the order in which they arise:

- missing pixels: what the projector, beside the camera, cannot light, and pixels whose matching
  window straddles a depth edge;
- lateral jitter of the pixel that is read, 0.5 px (Barron & Malik, CVPR 2013; Handa et al., ICRA
  2014), which makes edges ragged;
- axial noise that grows with depth and with the angle of the surface (Nguyen, Izadi & Lovell,
  3DIMPVT 2012);
- quantisation of disparity, whose step in depth grows with depth squared (Khoshelham & Elberink,
  Sensors 2012: 2.85 mm at 1 m).

Nguyen's deviations were measured on quantised depth, so that the sum is a little pessimistic.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import Array, backproject, normalise

BASELINE = 0.075  # metres, from the camera to the projector on its left (first Kinect)
QUANTISATION = 2.85e-3  # 1/metres: step of depth at 1 m
JITTER = 0.5  # pixels
EDGE = 0.02  # relative jump of depth inside a 3 x 3 window that breaks matching
STEEPEST = np.deg2rad(80)  # beyond this the noise model has no measurement and no finite value


def add_depth_noise(depth: Array, K: Array, rng: np.random.Generator) -> NDArray[np.float32]:
    """Depth as a structured-light camera would give it.

    depth : (H, W) float, metres along z; 0 or not finite = nothing there
    K : (3, 3) pinhole intrinsics, pixels
    Returns (H, W) float32, metres; 0 = no return. The same generator state gives the same bytes.
    """
    clean = np.where(np.isfinite(depth) & (depth > 0), depth, 0.0).astype(np.float64)
    missing = (clean == 0) | projector_shadow(clean, float(K[0, 0])) | depth_edges(clean)
    deviation = axial_deviation(clean, incidence_angle(clean, K))
    noise = rng.standard_normal(clean.shape)
    jittered = _read_beside(clean, rng)
    noisy = np.where(jittered > 0, jittered + deviation * noise, 0.0)
    return np.where(missing, 0.0, quantise(noisy)).astype(np.float32)


def axial_deviation(depth: Array, angle: Array) -> NDArray[np.float64]:
    """Standard deviation in metres at `depth` (metres) and `angle` (radians between the surface's
    normal and the ray): 0.0012 + 0.0019 (z - 0.4)^2 + 0.0001 / sqrt(z) angle^2 / (pi/2 - angle)^2.
    """
    angle = np.minimum(angle, STEEPEST)
    root = np.sqrt(np.where(depth > 0, depth, 1.0))
    tilt = 0.0001 / root * angle**2 / (np.pi / 2 - angle) ** 2
    return np.asarray(0.0012 + 0.0019 * (depth - 0.4) ** 2 + tilt, dtype=np.float64)


def incidence_angle(depth: Array, K: Array) -> NDArray[np.float64]:
    """(H, W) angle in radians between the surface's normal and the ray; 0 where unknown."""
    points = backproject(depth, K).astype(np.float64)
    normals = normalise(np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0)))
    cosine = np.abs(np.sum(normals * normalise(points), axis=-1))
    return np.arccos(np.clip(np.nan_to_num(cosine, nan=1.0), 0.0, 1.0))


def quantise(depth: Array) -> NDArray[np.float64]:
    """Depth rounded to whole steps of disparity; 0 stays 0 and negative depth becomes 0."""
    positive = depth > 0
    steps = np.rint(1.0 / (QUANTISATION * np.where(positive, depth, 1.0)))
    return np.where(positive, 1.0 / (QUANTISATION * np.maximum(steps, 1.0)), 0.0)


def projector_shadow(depth: Array, focal: float) -> NDArray[np.bool_]:
    """(H, W) True where the projector's light falls on something nearer.

    A pixel u at depth z lies in the projector's column u + f b / z. The light reaches it unless a
    pixel further left lies in the same or a later column.
    """
    valid = depth > 0
    shift = focal * BASELINE / np.where(valid, depth, np.inf)
    column = np.where(valid, np.arange(depth.shape[1]) + shift, -np.inf)
    before = np.maximum.accumulate(column, axis=1)[:, :-1]
    shadow = np.zeros(depth.shape, dtype=bool)
    shadow[:, 1:] = valid[:, 1:] & (before >= column[:, 1:])
    return shadow


def depth_edges(depth: Array) -> NDArray[np.bool_]:
    """(H, W) True where depth jumps by more than `EDGE` of itself within 3 x 3 pixels."""
    padded = np.pad(depth, 1, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    spread = windows.max(axis=(2, 3)) - windows.min(axis=(2, 3))
    return np.asarray(spread > EDGE * np.where(depth > 0, depth, 1.0))


def _read_beside(depth: Array, rng: np.random.Generator) -> Array:
    height, width = depth.shape
    shift = np.rint(rng.normal(0.0, JITTER, (2, height, width))).astype(np.int64)
    row = np.clip(np.arange(height)[:, None] + shift[0], 0, height - 1)
    column = np.clip(np.arange(width)[None, :] + shift[1], 0, width - 1)
    return depth[row, column]
