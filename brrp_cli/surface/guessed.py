"""What is guessed is the less certain, the further it lies from what was seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.inference.hypothesis_posterior import HypothesisPosterior


def with_guesses(
    deviation: NDArray[np.float32],
    vertices: NDArray[np.float64],
    observed: NDArray[np.floating],
    posterior: HypothesisPosterior,
    by_distance: float,
) -> NDArray[np.float32]:
    """Standard deviation (n,), metres, of a surface that is no stored object's.

    How fast occupancy falls tells what the hypotheses about an object disagree on. In what all of
    them have wrong they agree, and that grows with the way to the nearest point that was measured.

    deviation : (n,) metres, by the hypotheses, at vertices (n, 3), metres, camera frame; observed :
    (m, 3); by_distance : metres for a metre from the nearest of these, of what is guessed alone
    """
    weight = posterior.guessed_weight
    if weight == 0:
        return deviation
    away, _ = import_library("scipy.spatial").cKDTree(observed).query(vertices)
    added = by_distance * np.sqrt(weight) * away
    return np.hypot(deviation, added).astype(np.float32)
