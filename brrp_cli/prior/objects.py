"""What the prior knows of one object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.descriptors.descriptor import Appearance
from brrp_cli.descriptors.fpfh import FeatureCloud
from brrp_cli.prior.distance_field import DistanceField


@dataclass(frozen=True)
class RestingPose:
    """A stable pose on a plane z = 0, z up. T_plane_object acts on the mesh's own metres."""

    T_plane_object: NDArray[np.float64]
    probability: float


@dataclass(frozen=True)
class PriorObject:
    """One stored object.

    Samples, surface and clouds are normalised: x = (mesh point - center) / half_extent, so that
    the bounding box is centred on 0 and its largest half-extent is 1.

    Attributes
    ----------
    name : unique in the prior; description : short phrase for CLIP
    center : (3,) float64, metres, mesh frame; half_extent : metres
    samples : (n, 3) float32, normalised; labels : (n,) bool, True = inside
    surface, surface_normals : (m, 3) float32, normalised; unit outward normals
    clouds : one FeatureCloud for each scale of the scan, already multiplied by
        base_scale * scale: metres, centred on the bounding box
    poses : resting poses, most probable first
    record : how it was made (repair, sample mix, original size); plain JSON
    appearance : what it looks like; its colours are 0 where the mesh has none
    distances : signed distances to its surface, normalised
    """

    name: str
    description: str
    center: NDArray[np.float64]
    half_extent: float
    samples: NDArray[np.float32]
    labels: NDArray[np.bool_]
    surface: NDArray[np.float32]
    surface_normals: NDArray[np.float32]
    clouds: dict[float, FeatureCloud]
    poses: list[RestingPose]
    record: dict[str, Any]
    appearance: Appearance
    distances: DistanceField
