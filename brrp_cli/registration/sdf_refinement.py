"""Point-to-SDF refinement of many placements at once: observed points come onto the surface.

Gauss-Newton on the sum of squared signed distances, which a grid holds: point-to-plane ICP
without a search for the nearest point, whose plane is that of the surface and not of a sample.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.distance_loops import refined
from brrp_cli.registration.model import ModelGeometry

Array = NDArray[np.float64]

# Placements that turn (radians) and move (metres) by less in a step stand still: a tenth of what a
# depth camera can tell.
STILL = 1e-4
# Of the mean diagonal: what is not seen of a ball's turn is not turned.
DAMPING = 1e-6
# A step changes the size by this share at most.
MOST_RESIZED = 0.1


def refine_to_sdf(
    T_model_cam: Array,
    observed: Array,
    model: ModelGeometry,
    distance: float,
    iterations: int,
    *,
    resize: bool = False,
) -> Array:
    """T_model_cam (B, 4, 4), similarities, each followed by the rigid motion that brings observed
    points (n, 3), metres, camera frame, onto the model's surface; with `resize`, by a change of
    size too.

    distance : points further from it than that, metres of the model, do not pull
    iterations : steps at most; a placement that stands still is left alone before
    """
    field = model.field
    return refined(
        field.values,
        field.lower,
        field.spacing,
        model.half_extent,
        np.ascontiguousarray(T_model_cam, dtype=np.float64),
        np.ascontiguousarray(observed, dtype=np.float64),
        distance,
        iterations,
        7 if resize else 6,
        DAMPING,
        STILL,
        MOST_RESIZED,
    )
