"""How far observed points lie from a placed object, and which placement that speaks for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import cells_of, transform_points
from brrp_cli.registration.pose_search import Hypothesis
from brrp_cli.registration.transform_loops import inverses

Array = NDArray[np.float64]


def distances(
    T_cam_model: Array, placed: Hypothesis, points: Array, *, exact: bool = False
) -> Array:
    """(K, n) metres of points (n, 3), camera frame, from the surface under each placement; by the
    coarse field, or exact."""
    stored = placed.model.stored
    T_model_cam = inverses(T_cam_model)
    moved = np.concatenate([transform_points(each, points) for each in T_model_cam])
    if exact:
        distance = stored.shape.distance(moved / stored.half_extent) * stored.half_extent
    else:
        distance = np.abs(placed.model.signed_distance(moved))
    return np.asarray((distance * placed.scale).reshape(len(T_cam_model), -1))


def worse_than(
    first: int, of: Array, points: Array, patch: float, exact: float
) -> tuple[Array, Array]:
    """Mean (K,), metres, by which points lie further from the surface under each placement than
    under one of them, and its standard error over patches: neighbouring pixels err together.

    exact : metres to which such a mean is known, however many points there are: facets and files
    are no more exact
    """
    difference = of - of[first]
    cell = cells_of(points, patch)
    mean = difference.mean(axis=1)
    residual = difference - mean[:, None]
    sums = np.stack([np.bincount(cell, weights=each) for each in residual])
    return mean, np.hypot(np.sqrt((sums**2).sum(axis=1)) / len(points), exact)
