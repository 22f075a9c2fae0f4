"""What the prior knows of one object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.descriptors.descriptor import Appearance
from brrp_cli.descriptors.fpfh import FeatureCloud
from brrp_cli.prior.shape import StoredShape


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
    appearance : what it looks like
    shape : its closed mesh with colours, and signed distances; normalised
    """

    name: str
    description: str
    center: NDArray[np.float64]
    half_extent: float
    samples: NDArray[np.float32]
    labels: NDArray[np.bool_]
    surface: NDArray[np.float32]
    surface_normals: NDArray[np.float32]
    clouds: Mapping[float, FeatureCloud]
    poses: list[RestingPose]
    record: dict[str, Any]
    appearance: Appearance
    shape: StoredShape

    def mesh_pose(self, T_cam_object: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """The rigid pose (4, 4) of the object's own mesh file, metres, and the factor of its size,
        for T_cam_object (4, 4), a similarity from normalised coordinates."""
        scale = float(np.cbrt(np.linalg.det(T_cam_object[:3, :3])))
        factor = scale / self.half_extent
        T_cam_mesh = np.eye(4)
        T_cam_mesh[:3, :3] = T_cam_object[:3, :3] / scale
        # x_object = (x_mesh - center) / half_extent
        T_cam_mesh[:3, 3] = T_cam_object[:3, 3] - factor * T_cam_mesh[:3, :3] @ self.center
        return T_cam_mesh, factor
