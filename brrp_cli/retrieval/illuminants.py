"""Lights that an image may have been taken in, as factors of its red, green and blue.

The stored colours are those of the textures. A camera that saw them darker, or in yellower light,
is undone by a gain above 1, or by one that is larger for blue.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

BRIGHTNESS = np.exp(np.linspace(np.log(0.5), np.log(2.2), 9))
WARMTH = np.array([0.8, 0.9, 1.0, 1.11, 1.25])  # red over blue
TINT = np.array([0.95, 1.0, 1.06])  # green over the middle of red and blue
# How far brightness and warmth lie from 1 before they are seen, standard deviations of logarithms.
BRIGHTNESS_SPREAD = 0.5
WARMTH_SPREAD = 0.3
# How much the light on one object differs from that on the scene: what faces the lamp, what stands
# in a shadow, what reflects a coloured neighbour.
LOCAL_BRIGHTNESS_SPREAD = 0.2
LOCAL_WARMTH_SPREAD = 0.08


def lights() -> NDArray[np.float64]:
    """(g, 3) gains of red, green and blue."""
    table = [
        (b * np.sqrt(w), b * t, b / np.sqrt(w)) for b, w, t in product(BRIGHTNESS, WARMTH, TINT)
    ]
    return np.array(table)


def local_lights(gains: NDArray[np.floating]) -> NDArray[np.float64]:
    """P(light on an object | light of the scene) (g, g): row: the scene's, column: the object's."""
    logs = np.log(gains)
    apart = logs[:, None] - logs[None]
    brightness = apart.mean(axis=-1) / LOCAL_BRIGHTNESS_SPREAD
    warmth = (apart[..., 0] - apart[..., 2]) / LOCAL_WARMTH_SPREAD
    tint = (apart[..., 1] - (apart[..., 0] + apart[..., 2]) / 2) / LOCAL_WARMTH_SPREAD
    weight = np.exp(-0.5 * (brightness**2 + warmth**2 + tint**2))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def log_prior(gains: NDArray[np.floating]) -> NDArray[np.float64]:
    """How likely gains (g, 3) are before anything is seen (g,), up to a constant."""
    logs = np.log(gains)
    brightness = logs.mean(axis=1) / BRIGHTNESS_SPREAD
    warmth = (logs[:, 0] - logs[:, 2]) / WARMTH_SPREAD
    return np.asarray(-0.5 * (brightness**2 + warmth**2))
