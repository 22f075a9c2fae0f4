"""Light of other colour and brightness, as a camera that does not make up for it shows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Bounds of the draws: lamps from 2,700 K to 10,000 K behind a fixed white balance shift red against
# blue by about this much; exposure is off by a stop at most; cheap cameras show duller colours.
BRIGHTNESS = (0.55, 1.6)
WARMTH = (0.78, 1.28)
TINT = (0.94, 1.06)
GAMMA = (0.85, 1.2)
SATURATION = (0.7, 1.1)
NOISE = (0.5, 4.0)
# A lamp to one side: how much brighter that side of the image is than its middle.
SLOPE = (0.8, 1.25)

_LUMA = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True)
class Light:
    """gain : (3,) factor of red, green and blue; gamma : exponent of what is between black and
    white; saturation : factor of what differs from grey; slope : (2,) factor of the right and the
    lower edge; noise : standard deviation of a pixel, of 255."""

    gain: NDArray[np.float64]
    gamma: float
    saturation: float
    slope: NDArray[np.float64]
    noise: float


def draw_light(rng: np.random.Generator) -> Light:
    """One light for a scene; factors are uniform in their logarithm."""

    def draw(bounds: tuple[float, float]) -> float:
        return float(np.exp(rng.uniform(*np.log(bounds))))

    brightness, root, tint = draw(BRIGHTNESS), np.sqrt(draw(WARMTH)), draw(TINT)
    return Light(
        gain=brightness * np.array([root, tint, 1 / root]),
        gamma=draw(GAMMA),
        saturation=draw(SATURATION),
        slope=np.array([draw(SLOPE), draw(SLOPE)]),
        noise=draw(NOISE),
    )


def relight(rgb: NDArray[np.uint8], light: Light, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The image (H, W, 3) in that light; what becomes too bright is white, as in a camera."""
    height, width = rgb.shape[:2]
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    shade = light.slope[0] ** x * light.slope[1] ** y
    lit = (rgb / 255.0) ** light.gamma * light.gain * shade[..., None]
    grey = (lit @ _LUMA)[..., None]
    dull = grey + light.saturation * (lit - grey)
    noisy = 255 * dull + rng.normal(0.0, light.noise, rgb.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)
