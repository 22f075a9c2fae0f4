"""Pose and scale of a stored object from a partial view: RANSAC over a scan of scales.

Paper, section IV-A: FPFH matches between the stored cloud at each scale and the observed cloud,
RANSAC on triples of matches; the scale with most inlier pairs wins.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, RegistrationConfig
from brrp_cli.dependencies import import_open3d
from brrp_cli.geometry import similarity
from brrp_cli.prior.objects import FeatureCloud, PriorObject
from brrp_cli.registration.fpfh import fpfh_cloud
from brrp_cli.seeds import child_seed


@dataclass(frozen=True)
class ObservedCloud:
    """An observed object's features, about the centre of its bounding box.

    cloud : metres, camera axes, origin at `center`; center : (3,), metres, camera frame.
    """

    cloud: FeatureCloud
    center: NDArray[np.float64]


@dataclass(frozen=True)
class Placement:
    """A stored object placed in the scene.

    T_cam_object : (4, 4) similarity from the object's normalised coordinates to the camera frame;
    scale : member of the scan; inliers : pairs within the correspondence distance;
    fitness : inliers / points of the stored cloud, 0 to 1.
    """

    T_cam_object: NDArray[np.float64]
    scale: float
    inliers: int
    fitness: float


def observed_cloud(points: NDArray[np.floating], config: FeatureConfig) -> ObservedCloud:
    """Features of an object's observed points (n, 3), metres, camera frame; computed once."""
    points = np.asarray(points, dtype=np.float64)
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    # The camera is the origin of the camera frame: it stands at -center about the centre.
    return ObservedCloud(fpfh_cloud(points - center, config, viewpoint=-center), center)


def register(
    observed: ObservedCloud,
    stored: PriorObject,
    features: FeatureConfig,
    config: RegistrationConfig,
    seed: int,
    *,
    scales: Iterable[float] | None = None,
) -> Placement | None:
    """Place a stored object at the scale of the scan with most inlier pairs.

    scales : the members of the scan to try, all by default. Returns None when no scale has more
    inliers than one draw has points: Open3D then returns the identity. The first of equal scales
    wins.
    """
    best: Placement | None = None
    for scale in features.scales if scales is None else scales:
        source = stored.clouds[scale]
        T_center_source, inliers, fitness = _ransac(
            source, observed.cloud, config, child_seed(seed, "ransac", stored.name, str(scale))
        )
        if inliers > (best.inliers if best else config.draw):
            T_cam_center = similarity(translation=observed.center)
            T_source_object = similarity(scale=features.base_scale * scale)
            T_cam_object = T_cam_center @ T_center_source @ T_source_object
            best = Placement(T_cam_object, scale, inliers, fitness)
    return best


def _ransac(
    source: FeatureCloud, target: FeatureCloud, config: RegistrationConfig, seed: int
) -> tuple[NDArray[np.float64], int, float]:
    """Rigid T_target_source, its number of inlier pairs and their share of the source."""
    o3d = import_open3d()
    pipeline = o3d.pipelines.registration
    distance = config.correspondence_distance
    # Seeded right before the call, or an earlier draw in the process would change the result.
    o3d.utility.random.seed(seed)
    result = pipeline.registration_ransac_based_on_feature_matching(
        _cloud(source),
        _cloud(target),
        _feature(source),
        _feature(target),
        False,
        distance,
        pipeline.TransformationEstimationPointToPoint(False),
        config.draw,
        [
            pipeline.CorrespondenceCheckerBasedOnEdgeLength(config.edge_length),
            pipeline.CorrespondenceCheckerBasedOnDistance(distance),
        ],
        pipeline.RANSACConvergenceCriteria(config.iterations, config.confidence),
    )
    inliers = len(result.correspondence_set)
    return np.asarray(result.transformation).copy(), inliers, float(result.fitness)


def _cloud(cloud: FeatureCloud) -> object:
    o3d = import_open3d()
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points))


def _feature(cloud: FeatureCloud) -> object:
    feature = import_open3d().pipelines.registration.Feature()
    feature.data = cloud.fpfh.T
    return feature
