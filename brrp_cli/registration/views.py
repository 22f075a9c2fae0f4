"""All views of an object at rest, from the present one's camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrp_cli.registration.likelihood import SeenPixels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SeenFrom:
    """seen : the object in a frame; T_view_cam : (4, 4) rigid, from the present frame's camera to
    that one's"""

    seen: SeenPixels
    T_view_cam: Array


@dataclass(frozen=True)
class Views:
    """seen : from each, the present one among them; points : (n, 3) of all, metres, the present
    camera's frame, in random order; votes : how many views err independently"""

    seen: tuple[SeenFrom, ...]
    points: Array
    votes: float

    def joint(self, nats: Callable[[SeenFrom], ArrayLike]) -> Array:
        """Log likelihood ratios in all views, of those in each.

        Ratios of views that err independently add up: the mean of all counts `votes` times."""
        return np.asarray(
            self.votes * np.mean([np.asarray(nats(view)) for view in self.seen], axis=0)
        )
