"""What each particle of a posterior says, which the mean over particles hides."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior
from brrp_cli.inference.posterior import HilbertPosterior
from brrp_cli.reconstruction import Axes, OccupancyPosterior


def particle_volumes(posterior: OccupancyPosterior, axes: Axes) -> NDArray[np.float32]:
    """Occupancy probability (P, nx, ny, nz) of each particle on a grid of camera-frame
    coordinates, metres; their mean over P is `posterior.probability_volume(axes)`.

    V-PRISM and PointSDF have no particles: P is 1, and that is the mean.
    """
    if isinstance(posterior, HypothesisPosterior):
        logits = posterior.mean.volume(axes)[posterior.which]
        logits = logits + posterior.correction.logit_volume(axes)
    elif isinstance(posterior, HilbertPosterior):
        logits = posterior.logit_volume(axes)
    else:
        return posterior.probability_volume(axes)[None]
    return np.asarray(torch.sigmoid(torch.from_numpy(logits)).numpy())
