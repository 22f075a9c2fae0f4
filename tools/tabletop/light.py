"""Light of other colour and brightness, as a camera that does not make up for it shows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Bounds of the draws: lamps from 2,700 K to 10,000 K behind a fixed white balance shift red against
# blue by about this much; exposure is off by a stop at most.
BRIGHTNESS = (0.55, 1.6)
WARMTH = (0.78, 1.28)
TINT = (0.94, 1.06)
GAMMA = (0.85, 1.2)
NOISE = (0.5, 4.0)


@dataclass(frozen=True)
class Light:
    """gain : (3,) factor of red, green and blue; gamma : exponent of what is between black and
    white; noise : standard deviation of a pixel, of 255."""

    gain: NDArray[np.float64]
    gamma: float
    noise: float


def draw_light(rng: np.random.Generator) -> Light:
    """One light for a scene; factors are uniform in their logarithm."""
    brightness, warmth, tint, gamma, noise = (
        float(np.exp(rng.uniform(*np.log(bounds))))
        for bounds in (BRIGHTNESS, WARMTH, TINT, GAMMA, NOISE)
    )
    root = np.sqrt(warmth)
    return Light(brightness * np.array([root, tint, 1 / root]), gamma, noise)


def relight(rgb: NDArray[np.uint8], light: Light, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The image (H, W, 3) in that light; what becomes too bright is white, as in a camera."""
    linear = (rgb / 255.0) ** light.gamma * light.gain
    noisy = 255 * linear + rng.normal(0.0, light.noise, rgb.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)
