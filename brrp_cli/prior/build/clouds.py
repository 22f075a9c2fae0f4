"""Surface and feature clouds: all that registration needs of a stored object, made offline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.descriptors.fpfh import FeatureCloud, fpfh_cloud

Array = NDArray[np.float64]


def feature_clouds(
    points: Array, normals: Array, config: FeatureConfig
) -> dict[float, FeatureCloud]:
    """One cloud for each scale of the scan, from dense normalised points (n, 3) and their outward
    normals (paper, section IV-A)."""
    return {
        scale: fpfh_cloud(points * (config.base_scale * scale), config, normals=normals)
        for scale in config.scales
    }


def spread(points: Array, normals: Array, count: int) -> tuple[Array, Array]:
    """`count` of the points, evenly spread (farthest point sampling), with their normals."""
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    chosen = cloud.farthest_point_down_sample(count)
    return np.asarray(chosen.points).copy(), np.asarray(chosen.normals).copy()
