"""A stored object in its true size, ready to be tried on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import similarity
from brrp_cli.prior.objects import PriorObject


@dataclass(frozen=True)
class Model:
    """Metres, about the middle of the object's box, axes of its mesh.

    surface, normals : (n, 3), unit outward normals
    """

    stored: PriorObject
    surface: NDArray[np.float64]
    normals: NDArray[np.float64]

    def signed_distance(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Distance (n,), metres, of points (n, 3) to the surface, negative inside, from the coarse
        field."""
        unit = self.stored.half_extent
        return self.stored.shape.field.signed_distance(points / unit) * unit

    def distance_and_gradient(
        self, points: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """`signed_distance` (n,) and its gradient (3, n), at points (3, n)."""
        unit = np.float32(self.stored.half_extent)
        distance, gradient = self.stored.shape.field.distance_and_gradient(points / unit)
        return distance * unit, gradient

    @property
    def T_model_object(self) -> NDArray[np.float64]:
        """(4, 4), from the stored object's normalised coordinates."""
        return similarity(scale=self.stored.half_extent)

    @property
    def resting(self) -> list[NDArray[np.float64]]:
        """T_plane_model (4, 4) of each resting pose, most probable first."""
        T_object_model = similarity(translation=self.stored.center)
        return [pose.T_plane_object @ T_object_model for pose in self.stored.poses]


def search_model(stored: PriorObject) -> Model:
    """The model of a stored object."""
    return Model(
        stored,
        stored.surface.astype(np.float64) * stored.half_extent,
        stored.surface_normals.astype(np.float64),
    )
