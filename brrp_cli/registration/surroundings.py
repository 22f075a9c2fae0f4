"""Whether a pixel beside a mask has the colours of what lies around the object, or the object's.

Masks made from depth lose thin parts near the table. Such pixels have the object's colours; the
table under a thing that is not there has the table's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.descriptors.colour_histogram import lab

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Of this density, of any colour, is what fits neither side: it tells nothing.
_ANY = np.exp(-16.0)


@dataclass(frozen=True)
class Surroundings:
    """Colours (n, 3) of pixels of an object, `own`, and (m, 3) of the background, `around`:
    L*a*b*"""

    own: Array
    around: Array


def surroundings(rgb: NDArray[np.uint8], own: Mask, background: Mask, count: int) -> Surroundings:
    """`count` pixels of each at most, evenly drawn, those around from as far beside the object as
    it is wide.

    rgb : (h, w, 3); own, background : (h, w)
    """
    near = np.zeros_like(background)
    window = []
    for axis in (0, 1):
        rows = np.flatnonzero(own.any(axis=1 - axis))
        low, high = (int(rows[0]), int(rows[-1]) + 1) if len(rows) else (0, 0)
        window.append(slice(max(2 * low - high, 0), 2 * high - low))
    near[tuple(window)] = background[tuple(window)]

    def drawn(mask: Mask) -> Array:
        colours = rgb[mask]
        rows = np.linspace(0, len(colours) - 1, min(count, len(colours))).astype(np.int64)
        return lab(colours[rows].astype(np.float64))

    return Surroundings(drawn(own), drawn(near))


def like_surroundings(rgb: NDArray[np.uint8], sides: Surroundings, spread: float) -> Array:
    """Probability (n,) that colours (n, 3) are those around the object rather than its own, with
    even odds; 0.5 where a side has no pixels, or both have that colour.

    spread : standard deviation of the Gaussian about each colour, L*a*b*
    """
    if not len(rgb) or not len(sides.own) or not len(sides.around):
        return np.full(len(rgb), 0.5)
    seen = lab(rgb.astype(np.float64))

    def density(colours: Array) -> Array:
        # |a - b|^2 without the (n, m, 3) differences.
        square = (seen**2).sum(axis=1)[:, None] + (colours**2).sum(axis=1) - 2 * seen @ colours.T
        return np.exp(-0.5 * np.maximum(square, 0) / spread**2).mean(axis=1) + _ANY

    around = density(sides.around)
    return np.asarray(around / (around + density(sides.own)))
