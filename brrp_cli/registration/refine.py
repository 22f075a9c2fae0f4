"""Refine placements: ICP of the observed points onto the model's surface, point to plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d, one_openmp_thread

ITERATIONS = 20


def refine(
    T_observed_model: NDArray[np.floating],
    observed: NDArray[np.floating],
    model: NDArray[np.floating],
    normals: NDArray[np.floating],
    distance: float,
) -> NDArray[np.float64]:
    """Rigid T_observed_model (B, 4, 4), each moved so that observed points lie on the model.

    observed : (n, 3); model, normals : (m, 3), the model's surface, metres; distance : pairs
    further apart than this, metres, do not pull. The observed points are matched to the model and
    not the other way round, because the model's hidden side has nothing to be matched to.
    """
    o3d = import_open3d()
    pipeline = o3d.pipelines.registration
    target = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(model.astype(np.float64)))
    target.normals = o3d.utility.Vector3dVector(normals.astype(np.float64))
    source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(observed.astype(np.float64)))
    estimation = pipeline.TransformationEstimationPointToPlane()
    criteria = pipeline.ICPConvergenceCriteria(max_iteration=ITERATIONS)
    with one_openmp_thread():
        found = [
            pipeline.registration_icp(source, target, distance, T, estimation, criteria)
            for T in np.linalg.inv(T_observed_model)
        ]
    return np.linalg.inv(np.stack([each.transformation for each in found]))
