"""One registration of 30: both clouds' features computed anew, RANSAC, 100,000 iterations (paper,
section IV-A)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import Config
from brrp_cli.dependencies import import_open3d
from brrp_cli.prior.objects import PriorObject


def register(points: NDArray[np.floating], stored: PriorObject, config: Config) -> Any:
    """The best T_cam_object (4, 4) over the scan of scales for observed points (n, 3), metres,
    camera frame; None where no scale has an inlier."""
    best, transform = 0, None
    for scale in config.features.scales:
        size = config.features.base_scale * scale
        center = (points.min(axis=0) + points.max(axis=0)) / 2
        result = _ransac(
            _described(stored.surface * size, config),
            _described(points - center, config),
            config,
        )
        if len(result.correspondence_set) > best:
            best = len(result.correspondence_set)
            T_cam_object = np.array(result.transformation)
            T_cam_object[:3, :3] *= size
            T_cam_object[:3, 3] += center
            transform = T_cam_object
    return transform


def _described(points: NDArray[np.floating], config: Config) -> tuple[Any, Any]:
    o3d = import_open3d()
    features = config.features
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
    cloud = cloud.voxel_down_sample(features.voxel)
    search = o3d.geometry.KDTreeSearchParamHybrid
    cloud.estimate_normals(search(features.normal_radius, features.normal_neighbours))
    found = o3d.pipelines.registration.compute_fpfh_feature(
        cloud, search(features.fpfh_radius, features.fpfh_neighbours)
    )
    return cloud, found


def _ransac(source: tuple[Any, Any], target: tuple[Any, Any], config: Config) -> Any:
    pipeline = import_open3d().pipelines.registration
    ransac = config.registration
    return pipeline.registration_ransac_based_on_feature_matching(
        source[0],
        target[0],
        source[1],
        target[1],
        False,
        ransac.correspondence_distance,
        pipeline.TransformationEstimationPointToPoint(False),
        ransac.draw,
        [
            pipeline.CorrespondenceCheckerBasedOnEdgeLength(ransac.edge_length),
            pipeline.CorrespondenceCheckerBasedOnDistance(ransac.correspondence_distance),
        ],
        pipeline.RANSACConvergenceCriteria(ransac.iterations, ransac.confidence),
    )
