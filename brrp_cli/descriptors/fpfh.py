"""FPFH clouds: voxel downsampling, normals and features with the constants of one place.

Stored objects (offline) and observed objects (online) go through the same function, because
features are comparable only when they are made alike (paper, section IV-A; Rusu et al. 2009).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig
from brrp_cli.dependencies import import_open3d


@dataclass(frozen=True)
class FeatureCloud:
    """A cloud with what registration needs of it.

    points : (n, 3) float64, metres; normals : (n, 3) float64, unit, outward or towards the camera;
    fpfh : (n, 33) float64.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    fpfh: NDArray[np.float64]


def fpfh_cloud(
    points: NDArray[np.floating],
    config: FeatureConfig,
    *,
    normals: NDArray[np.floating] | None = None,
    viewpoint: NDArray[np.floating] | None = None,
) -> FeatureCloud:
    """Downsample, estimate normals, compute features.

    points : (n, 3), metres. Normals are estimated from neighbours within `normal_radius` and then
    oriented: along `normals` (n, 3), where the true outward ones are known, or towards
    `viewpoint` (3,), the camera's position in the frame of `points`. FPFH depends on that sign.
    """
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
    if normals is not None:
        cloud.normals = o3d.utility.Vector3dVector(normals.astype(np.float64))
    cloud = cloud.voxel_down_sample(config.voxel)
    outward = np.asarray(cloud.normals).copy() if normals is not None else None
    cloud.estimate_normals(
        o3d.geometry.KDTreeSearchParamHybrid(config.normal_radius, config.normal_neighbours)
    )
    estimated = np.asarray(cloud.normals).copy()
    if outward is None:
        eye = np.zeros(3) if viewpoint is None else np.asarray(viewpoint, dtype=np.float64)
        outward = eye - np.asarray(cloud.points)
    estimated[np.einsum("ij,ij->i", estimated, outward) < 0] *= -1
    cloud.normals = o3d.utility.Vector3dVector(estimated)
    feature = o3d.pipelines.registration.compute_fpfh_feature(
        cloud, o3d.geometry.KDTreeSearchParamHybrid(config.fpfh_radius, config.fpfh_neighbours)
    )
    return FeatureCloud(
        points=np.asarray(cloud.points).copy(),
        normals=estimated,
        fpfh=np.asarray(feature.data).T.copy(),
    )
