"""Pose and scale of a stored object from a partial view: RANSAC over a scan of scales.

Paper, section IV-A: FPFH matches between the stored cloud at each scale and the observed cloud,
RANSAC on triples of matches; the scale with most inlier pairs wins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import FeatureConfig, RegistrationConfig
from brrp_cli.descriptors.fpfh import FeatureCloud, fpfh_cloud
from brrp_cli.geometry import similarity
from brrp_cli.prior.objects import PriorObject
from brrp_cli.registration.ransac import match_features
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
) -> Placement | None:
    """Place a stored object at the scale of the scan with most inlier pairs.

    None when no scale has an inlier. The first of equal scales wins.
    """
    best: Placement | None = None
    for scale in features.scales:
        source = stored.clouds[scale]
        match_seed = child_seed(seed, "ransac", stored.name, str(scale))
        found = match_features(source, observed.cloud, config, match_seed)
        if found is not None and found.inliers > (best.inliers if best else 0):
            T_cam_center = similarity(translation=observed.center)
            T_source_object = similarity(scale=features.base_scale * scale)
            T_cam_object = T_cam_center @ found.T_target_source @ T_source_object
            best = Placement(T_cam_object, scale, found.inliers, found.fitness)
    return best
