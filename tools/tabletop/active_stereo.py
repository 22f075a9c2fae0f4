"""Two infrared views of a stage under a projector of dots: what an active stereo camera matches.

Laid out as Intel's D415: the left imager is the depth camera, the right one stands 55 mm to its
right, the projector between them, the colour camera 15 mm to its left (Keselman et al., "Intel
RealSense stereoscopic depth cameras", CVPR workshops 2017; Intel's D400 series data sheet).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.depth_noise.waves import waves
from tabletop.stage import Stage, pixel_rays

BASELINE = 0.055  # metres, left to right imager
COLOUR_TO_LEFT = 0.015  # metres, the left imager to the right of the colour camera
PROJECTOR = 0.029  # metres, to the right of the left imager
SAMPLES = 2  # rays along each side of a pixel: dots are about a pixel wide
AMBIENT = 0.12  # room light, of the brightest dot at 1 m
DOT_SPACING, DOT_SIZE = 3.2, 0.7  # pixels of an imager; spacing and standard deviation
SPECULAR, SHININESS = 0.6, 60.0  # strength and exponent of a highlight (Blinn-Phong)
EXPOSED = 70.0  # grey level of 255 that automatic exposure gives the mean pixel
# Laser speckle, which each imager sees otherwise: standard deviation, relative to the light.
SPECKLE = 0.2
SHOT, READ = 0.12, 1.2  # grey levels: variance per grey level, and standard deviation in the dark
# Pixels: what is left of distortion after calibration, right imager against left.
DISTORTION, DISTORTION_LENGTH = 0.05, 60.0


@dataclass(frozen=True)
class InfraredPair:
    """left, right : (H, W) uint8, rectified, disparity = u_left - u_right."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]


def infrared_pair(stage: Stage, rng: np.random.Generator) -> InfraredPair:
    """Both infrared images of a stage, with their noise and an imperfect calibration."""
    rays = pixel_rays(stage.K, stage.shape, SAMPLES)
    left = _picture(stage, COLOUR_TO_LEFT, rays)
    error = DISTORTION * waves(stage.shape, DISTORTION_LENGTH, rng)
    bent = rays.copy()
    bent[..., 0] += error.repeat(SAMPLES, 0).repeat(SAMPLES, 1) / stage.K[0, 0]
    right = _picture(stage, COLOUR_TO_LEFT + BASELINE, bent)
    gain = EXPOSED / max(float(left.mean()), 1e-6)
    return InfraredPair(_expose(left * gain, rng), _expose(right * gain, rng))


def _picture(stage: Stage, x: float, rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light (H, W) that arrives at an imager at x metres, mean over each pixel's rays."""
    eye = np.array([x, 0.0, 0.0])
    source = np.array([COLOUR_TO_LEFT + PROJECTOR, 0.0, 0.0])
    hits = stage.cast(eye, rays)
    light = source.astype(np.float32) - hits.points
    distance = _length(light) + np.float32(1e-6)
    light /= distance[..., None]
    sight = (-rays).astype(np.float32)
    sight /= _length(sight)[..., None]
    # Faces of a mesh are lit from either side: normals of users' meshes point both ways.
    side = np.sign(_dot(hits.normals, sight))
    cosine = np.clip(side * _dot(hits.normals, light), 0.0, None)
    half = light + sight
    highlight = np.clip(side * _dot(hits.normals, half) / _length(half), 0.0, None) ** SHININESS
    # Shadows by one ray a pixel: their outlines are matched to a pixel at best.
    lit = stage.lit(hits.points[::SAMPLES, ::SAMPLES], source)
    lit = lit.repeat(SAMPLES, 0).repeat(SAMPLES, 1)
    power = lit / np.maximum(distance, 0.1) ** 2
    dots = _dots_at(hits.points - source.astype(np.float32), stage)
    diffuse = hits.albedo * (1 - hits.gloss) * (AMBIENT + dots * power * cosine)
    # A highlight mirrors the whole projector, blurred: it carries hardly any dots.
    shine = hits.gloss * SPECULAR * highlight * power
    arrived = np.where(hits.depth > 0, diffuse + shine, 0.0)
    height, width = stage.shape
    return np.asarray(
        arrived.reshape(height, SAMPLES, width, SAMPLES).mean(axis=(1, 3)), dtype=np.float64
    )


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _length(a: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.sqrt(_dot(a, a)))


def _dots_at(points: NDArray[np.float32], stage: Stage) -> NDArray[np.float32]:
    """Brightness of the pattern where it falls on points (..., 3), projector's frame."""
    cv2: Any = import_library("cv2")
    height, width = stage.shape
    image = dot_pattern(height, width)
    z = np.maximum(points[..., 2], np.float32(1e-3))
    u = points[..., 0] / z * np.float32(2 * stage.K[0, 0]) + np.float32(image.shape[1] / 2)
    v = points[..., 1] / z * np.float32(2 * stage.K[1, 1]) + np.float32(image.shape[0] / 2)
    return np.asarray(cv2.remap(image, u, v, cv2.INTER_LINEAR))


@lru_cache(maxsize=4)
def dot_pattern(height: int, width: int) -> NDArray[np.float32]:
    """The projector's image, two samples a pixel, a half wider than the imagers' on every side.

    One dot at a random place in each cell of a grid: no two neighbourhoods are alike. It belongs to
    the camera, not to the scene.
    """
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(0)
    rows, columns = 4 * height, 4 * width
    spacing = 2 * DOT_SPACING
    y, x = np.mgrid[0 : rows / spacing, 0 : columns / spacing]
    y = ((y + rng.random(y.shape)) * spacing).astype(np.int64).clip(0, rows - 1)
    x = ((x + rng.random(x.shape)) * spacing).astype(np.int64).clip(0, columns - 1)
    image = np.zeros((rows, columns), dtype=np.float32)
    image[y, x] = rng.uniform(0.5, 1.0, y.shape)
    spread = 2 * DOT_SIZE
    return np.asarray(gaussian_filter(image, spread) * 2 * np.pi * spread**2, dtype=np.float32)


def _expose(light: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.uint8]:
    deviation = np.sqrt(READ**2 + SHOT * light + (SPECKLE * light) ** 2)
    noisy = light + deviation * rng.standard_normal(light.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)
