"""A stored object in its true size, ready to be tried on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import similarity
from brrp_cli.prior.distance_field import DistanceField
from brrp_cli.prior.objects import PriorObject

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


class ModelGeometry(Protocol):
    """What a placement is judged by. Metres, about the middle of the object's box, axes of its
    mesh."""

    @property
    def field(self) -> DistanceField:
        """Signed distances, normalised."""
        ...

    @property
    def half_extent(self) -> float:
        """Metres for a normalised unit."""
        ...

    @property
    def surface(self) -> Array:
        """(n, 3), metres."""
        ...

    @property
    def normals(self) -> Array:
        """(n, 3), unit, outward."""
        ...

    @property
    def resting(self) -> list[Array]:
        """T_plane_model (4, 4) of each resting pose, most probable first."""
        ...

    def signed_distance(self, points: NDArray[np.floating]) -> Array:
        """Distance (n,), metres, of points (n, 3) to the surface, negative inside."""
        ...

    def distance(self, points: Floats) -> Floats:
        """`signed_distance` (n,) at points (3, n), in single precision."""
        ...

    def distance_and_gradient(self, points: Floats) -> tuple[Floats, Floats]:
        """`signed_distance` (n,) and its gradient (3, n), at points (3, n)."""
        ...


@dataclass(frozen=True)
class BareModel:
    """A stored object's geometry alone, as `ModelGeometry` has it.

    field : signed distances, normalised; half_extent : metres for a normalised unit
    """

    field: DistanceField
    half_extent: float
    surface: Array
    normals: Array
    resting: list[Array]

    def signed_distance(self, points: NDArray[np.floating]) -> Array:
        """Distance (n,), metres, of points (n, 3) to the surface, negative inside, from the coarse
        field."""
        return self.field.signed_distance(points / self.half_extent) * self.half_extent

    def distance(self, points: Floats) -> Floats:
        """`signed_distance` (n,) at points (3, n), in single precision."""
        unit = np.float32(self.half_extent)
        return self.field.distance(points / unit) * unit

    def distance_and_gradient(self, points: Floats) -> tuple[Floats, Floats]:
        """`signed_distance` (n,) and its gradient (3, n), at points (3, n)."""
        unit = np.float32(self.half_extent)
        distance, gradient = self.field.distance_and_gradient(points / unit)
        return distance * unit, gradient


@dataclass(frozen=True)
class Model:
    """A whole stored object, with its geometry as `ModelGeometry` has it."""

    stored: PriorObject
    surface: Array
    normals: Array

    def signed_distance(self, points: NDArray[np.floating]) -> Array:
        """As that of `BareModel`."""
        return self._bare.signed_distance(points)

    def distance(self, points: Floats) -> Floats:
        """As that of `BareModel`."""
        return self._bare.distance(points)

    def distance_and_gradient(self, points: Floats) -> tuple[Floats, Floats]:
        """As that of `BareModel`."""
        return self._bare.distance_and_gradient(points)

    @property
    def field(self) -> DistanceField:
        """As that of `BareModel`."""
        return self.stored.shape.field

    @property
    def half_extent(self) -> float:
        """As that of `BareModel`."""
        return self.stored.half_extent

    @property
    def T_model_object(self) -> Array:
        """(4, 4), from the stored object's normalised coordinates."""
        return similarity(scale=self.stored.half_extent)

    @property
    def resting(self) -> list[Array]:
        """T_plane_model (4, 4) of each resting pose, most probable first."""
        T_object_model = similarity(translation=self.stored.center)
        return [pose.T_plane_object @ T_object_model for pose in self.stored.poses]

    @property
    def _bare(self) -> BareModel:
        return BareModel(self.field, self.half_extent, self.surface, self.normals, [])


def search_model(stored: PriorObject) -> Model:
    """The model of a stored object."""
    return Model(
        stored,
        stored.surface.astype(np.float64) * stored.half_extent,
        stored.surface_normals.astype(np.float64),
    )
