"""Lights that an image may have been taken in, as factors of its red, green and blue.

The stored colours are those of the textures. A camera that saw them darker, or in yellower light,
is undone by a gain above 1, or by one that is larger for blue.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import IlluminantsConfig


def lights(config: IlluminantsConfig) -> NDArray[np.float64]:
    """(g, 3) gains of red, green and blue."""
    ends = np.log(config.darkest), np.log(config.brightest)
    brightness = np.exp(np.linspace(*ends, config.brightness))
    table = [
        (b * np.sqrt(w), b * t, b / np.sqrt(w))
        for b, w, t in product(brightness, np.array(config.warmth), np.array(config.tint))
    ]
    return np.array(table)


def local_lights(gains: NDArray[np.floating], config: IlluminantsConfig) -> NDArray[np.float64]:
    """P(light on an object | light of the scene) (g, g): row: the scene's, column: the object's."""
    logs = np.log(gains)
    apart = logs[:, None] - logs[None]
    brightness = apart.mean(axis=-1) / config.local_brightness_spread
    warmth = (apart[..., 0] - apart[..., 2]) / config.local_warmth_spread
    tint = (apart[..., 1] - (apart[..., 0] + apart[..., 2]) / 2) / config.local_warmth_spread
    weight = np.exp(-0.5 * (brightness**2 + warmth**2 + tint**2))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def log_prior(gains: NDArray[np.floating], config: IlluminantsConfig) -> NDArray[np.float64]:
    """How likely gains (g, 3) are before anything is seen (g,), up to a constant."""
    logs = np.log(gains)
    brightness = logs.mean(axis=1) / config.brightness_spread
    warmth = (logs[:, 0] - logs[:, 2]) / config.warmth_spread
    return np.asarray(-0.5 * (brightness**2 + warmth**2))
