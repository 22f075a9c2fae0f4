"""What a frame says for and against a placed model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import project


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
    seen = model[model[:, 2] > 0]
    pixels = np.rint(project(seen, frame.K)).astype(np.int64)
    height, width = frame.shape
    inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
    columns, rows = pixels[inside].T
    # NaN, no return, compares as false.
    in_front = frame.points[rows, columns, 2] > seen[inside, 2] + tolerance
    return float(in_front.sum() / max(len(model), 1))
