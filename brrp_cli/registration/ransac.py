"""RANSAC on FPFH matches (paper, section IV-A; Open3D)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import RegistrationConfig
from brrp_cli.dependencies import import_open3d, seeded_open3d
from brrp_cli.descriptors.fpfh import FeatureCloud


@dataclass(frozen=True)
class Match:
    """A rigid T_target_source (4, 4), its inlier pairs, and their share of the source, 0 to 1."""

    T_target_source: NDArray[np.float64]
    inliers: int
    fitness: float


def match_features(
    source: FeatureCloud, target: FeatureCloud, config: RegistrationConfig, seed: int
) -> Match | None:
    """The rigid motion with most inlier pairs; None when no draw of matches holds together."""
    pipeline = import_open3d().pipelines.registration
    distance = config.correspondence_distance
    clouds = _cloud(source), _cloud(target)
    matched = pipeline.correspondences_from_features(_feature(source), _feature(target), False)
    with seeded_open3d(seed):
        result = pipeline.registration_ransac_based_on_correspondence(
            *clouds,
            matched,
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
    # A draw that holds has at least its own pairs; without one, Open3D returns the identity.
    if inliers <= config.draw:
        return None
    return Match(np.asarray(result.transformation).copy(), inliers, float(result.fitness))


def match_pairs(source: FeatureCloud, target: FeatureCloud) -> NDArray[np.int64]:
    """Rows (m, 2) of source and target: for each source point the target's with the most similar
    feature."""
    matched = import_open3d().pipelines.registration.correspondences_from_features(
        _feature(source), _feature(target), False
    )
    return np.asarray(matched, dtype=np.int64).reshape(-1, 2)


def _cloud(cloud: FeatureCloud) -> object:
    o3d = import_open3d()
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud.points))


def _feature(cloud: FeatureCloud) -> object:
    feature = import_open3d().pipelines.registration.Feature()
    feature.data = cloud.fpfh.T
    return feature
