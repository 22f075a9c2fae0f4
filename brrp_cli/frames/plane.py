"""The support plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import ObservationConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.seeds import child_rng, child_seed

MIN_PLANE_POINTS = 100
_RANSAC_POINTS = 20_000


@dataclass(frozen=True)
class Plane:
    """Points x with normal . x + offset = 0; the objects' side is positive.

    normal : (3,) float64, unit, camera frame; offset : metres.
    """

    normal: NDArray[np.float64]
    offset: float

    def signed_distance(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """(...,) metres above the plane of points (..., 3), camera frame."""
        return np.asarray(points @ self.normal + self.offset, dtype=np.float64)


def fit_plane(
    points: NDArray[np.floating],
    config: ObservationConfig,
    seed: int,
    toward: NDArray[np.floating],
) -> Plane | None:
    """RANSAC over the points within `config.plane_radius` of the scene's centre.

    The plane of the largest consensus is fitted again, by least squares, to all of its inliers.

    points : (n, 3) background points, metres, camera frame, finite
    toward : (3,) the scene's centre; the normal is turned to its side
    Returns None where fewer than `MIN_PLANE_POINTS` points are near or agree on a plane.
    """
    near = points[np.linalg.norm(points - toward, axis=-1) < config.plane_radius]
    if len(near) < MIN_PLANE_POINTS:
        return None
    centred = near.astype(np.float64) - toward
    drawn = centred
    if len(centred) > _RANSAC_POINTS:
        rows = child_rng(seed, "plane", "points").choice(len(centred), _RANSAC_POINTS, False)
        drawn = centred[rows]
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(drawn))
    o3d.utility.random.seed(child_seed(seed, "plane"))
    model, _ = cloud.segment_plane(
        config.plane_tolerance, ransac_n=3, num_iterations=config.plane_iterations
    )
    for _ in range(2):
        inliers = centred[np.abs(centred @ model[:3] + model[3]) < config.plane_tolerance]
        if len(inliers) < MIN_PLANE_POINTS:
            return None
        middle = inliers.mean(axis=0)
        spread = inliers - middle
        normal = np.linalg.eigh(spread.T @ spread)[1][:, 0]
        model = np.append(normal, -normal @ middle)
    if model[3] < 0:  # the scene's centre is the origin here
        model = -model
    return Plane(normal=model[:3].copy(), offset=float(model[3] - model[:3] @ toward))
