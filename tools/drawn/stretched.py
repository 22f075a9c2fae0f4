"""Stretches of a shape at random: a mug that is twice as wide is a mug as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Standard deviations of logarithms: of the size, and of the length along each axis.
SIZE, AXIS = 0.15, 0.2


def draw_stretch(rng: np.random.Generator) -> NDArray[np.float64]:
    """(3,) factors, one for each axis."""
    return np.exp(rng.normal(0, SIZE) + rng.normal(0, AXIS, 3))
