"""Where a training asks: near the surface, around the object, and far from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import transform_points
from brrp_cli.ground_truth.metrics import sample_surface
from brrp_cli.raycast import Solid

# Shares of the queries; the rest is drawn far away. Neither the paper nor PointSDF's says where
# occupancy was asked: near the surface is where shape is decided, and what is never asked about far
# away a network may fill.
NEAR, AROUND = 0.5, 0.375
NEAR_SPREAD = 0.015  # metres, standard deviation of each coordinate
AROUND_MARGIN = 0.03  # metres that the true bounding box is grown by
FAR_HALF_WIDTH = 0.25  # metres, of a cube around the middle of what was seen


def draw_queries(
    solid: Solid,
    T_query_solid: NDArray[np.float64],
    count: int,
    scale: float,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float16], NDArray[np.bool_]]:
    """Points (count, 3) in units of `scale` and whether they are occupied (count,).

    T_query_solid : similarity from the solid's frame to the one of the queries, metres, whose
    origin is the middle of what was seen. The labels are those of the points as they are returned,
    rounded to float16 (0.1 mm at 0.2 m).
    """
    near, around = round(NEAR * count), round(AROUND * count)
    unit = np.cbrt(np.linalg.det(T_query_solid[:3, :3]))  # metres in a unit of the solid's frame
    surface = sample_surface(solid.mesh, near, rng)
    low, high = solid.bounds + np.array([[-AROUND_MARGIN], [AROUND_MARGIN]]) / unit
    own = np.concatenate(
        [
            surface + rng.normal(0, NEAR_SPREAD / unit, (near, 3)),
            rng.uniform(low, high, (around, 3)),
        ]
    )
    far = rng.uniform(-FAR_HALF_WIDTH, FAR_HALF_WIDTH, (count - near - around, 3))
    points = np.concatenate([transform_points(T_query_solid, own), far])
    queries = (points / scale).astype(np.float16)
    asked = transform_points(np.linalg.inv(T_query_solid), queries.astype(np.float64) * scale)
    return queries, solid.inside(asked)
