"""The prior mean function of a stored object that was placed in the scene.

m(x) = -d(x) / width, limited to +-limit, with d the signed distance to the placed surface,
evaluated in the model's own frame: exact within the band where the logit is not at its limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import transform_points
from brrp_cli.prior.shape import StoredShape
from brrp_cli.reconstruction import Axes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlacedShape:
    """A stored shape where a hypothesis puts it.

    T_cam_shape : (4, 4) similarity from the shape's coordinates; width : metres, scale of the
    logistic function across the surface; limit : of the logit
    """

    name: str
    shape: StoredShape
    T_cam_shape: Array
    width: float
    limit: float

    @property
    def unit(self) -> float:
        """Metres of one unit of the shape's coordinates."""
        return float(np.cbrt(np.linalg.det(self.T_cam_shape[:3, :3])))

    @property
    def vertices(self) -> Array:
        """(n, 3) metres, camera frame."""
        vertices = transform_points(self.T_cam_shape, self.shape.vertices.astype(np.float64))
        return np.asarray(vertices, dtype=np.float64)

    @property
    def normals(self) -> Array:
        """(n, 3) unit, outward, camera frame."""
        return np.asarray(self.shape.normals @ (self.T_cam_shape[:3, :3] / self.unit).T)

    @property
    def bounds(self) -> Array:
        """(2, 3) metres, camera frame."""
        vertices = self.vertices
        return np.stack([vertices.min(axis=0), vertices.max(axis=0)])

    def signed_distance(self, points: NDArray[np.floating], band: float) -> Array:
        """Distance (n,), metres, of points (n, 3), camera frame; exact where it is under `band`."""
        local = transform_points(np.linalg.inv(self.T_cam_shape), np.asarray(points, np.float64))
        return self.shape.signed_distance(local, band / self.unit) * self.unit

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m (n,) at points (n, 3), metres, camera frame."""
        distance = self.signed_distance(points, self.limit * self.width)
        limited = np.clip(-distance / self.width, -self.limit, self.limit)
        return np.asarray(limited, dtype=np.float32)

    def volume(self, axes: Axes) -> NDArray[np.float32]:
        """m (nx, ny, nz) on a grid of camera-frame coordinates, metres."""
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        return self.logits(nodes.reshape(-1, 3)).reshape(nodes.shape[:3])
