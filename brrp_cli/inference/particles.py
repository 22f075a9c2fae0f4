"""What each particle of a posterior says, which the mean over particles hides."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from brrp_cli.reconstruction import Axes, OccupancyPosterior


@runtime_checkable
class HasParticles(Protocol):
    """A posterior of several particles."""

    def particle_volumes(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy probability (P, nx, ny, nz) of each particle on a grid of camera-frame
        coordinates, metres."""


def particle_volumes(posterior: OccupancyPosterior, axes: Axes) -> NDArray[np.float32]:
    """Occupancy probability (P, nx, ny, nz) of each particle on a grid of camera-frame
    coordinates, metres; their mean over P, by `particle_shares`, is
    `posterior.probability_volume(axes)`.

    Where a posterior has no particles P is 1, and that is the mean.
    """
    if isinstance(posterior, HasParticles):
        return posterior.particle_volumes(axes)
    return posterior.probability_volume(axes)[None]


def particle_shares(posterior: OccupancyPosterior, count: int) -> NDArray[np.float64]:
    """(P,), sum 1, how much each of `count` particles weighs: the same where the posterior does not
    say."""
    shares = getattr(posterior, "shares", None)
    return np.full(count, 1 / count) if shares is None else np.asarray(shares)
