"""What a frame says for and against a placed model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind


def explained(
    observed: NDArray[np.floating], model: NDArray[np.floating], distance: float
) -> float:
    """Share of observed points (n, 3) within `distance` metres of a model point (m, 3)."""
    nearest, _ = cKDTree(model).query(observed, distance_upper_bound=distance)
    return float(np.isfinite(nearest).mean())


def contradicted(model: NDArray[np.floating], frame: Frame, tolerance: float) -> float:
    """Share of model points (m, 3), metres, camera frame, in space that the camera saw to be free.

    A point is contradicted when its pixel has a return more than `tolerance` metres behind it.
    Points outside the image or on pixels without a return say nothing.
    """
    # NaN, no return, compares as false.
    return float((depth_behind(model, frame) > tolerance).sum() / max(len(model), 1))
