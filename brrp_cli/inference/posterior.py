"""The posterior of one object's shape: particles over Hilbert-map weights, asked at points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from brrp_cli.inference.hinge import HingeGrid, factors, grid_logits
from brrp_cli.reconstruction import LOGIT_VARIANCE, Axes

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts

# The standard deviation of a logistic distribution over its scale.
LOGISTIC_DEVIATION = np.pi / np.sqrt(3)
# So many points at once: their products stay in the cache.
CHUNK = 2_048


@dataclass(frozen=True)
class HilbertPosterior:
    """Particles over the weights of a Hilbert map around one object.

    weights : (P, H + 1) float32; center : (3,) float64, metres, camera frame, centre of the hinge
    grid; reach : half-width of the cube in which samples constrained the map, metres.
    """

    kind: ClassVar[str] = "hilbert_map"

    weights: NDArray[np.float32]
    center: NDArray[np.float64]
    grid: HingeGrid
    reach: float

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame: the cube outside of which no sample was drawn."""
        return np.stack([self.center - self.reach, self.center + self.reach])

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """w . phi (P, n) at points (n, 3), metres, camera frame."""
        # Centre in float64: kernels of centimetres leave no room for float32 far from the origin.
        local = torch.from_numpy((np.asarray(points, np.float64) - self.center).astype(np.float32))
        weights = torch.from_numpy(self.weights)
        parts = [factors(part, self.grid).dot(weights[:, 1:]) for part in local.split(CHUNK)]
        return np.asarray((torch.cat(parts, dim=1) + weights[:, :1]).numpy())

    def probability(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Occupancy probability (n,): mean over particles of sigmoid(w . phi)."""
        return mean_occupancy(self.logits(points))

    def uncertainty(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Variance over particles of w . phi, (n,)."""
        return np.asarray(self.logits(points).var(axis=0))

    @property
    def surface_unit(self) -> str:
        """Unit of `surface_uncertainty`."""
        return LOGIT_VARIANCE

    def surface_uncertainty(self, vertices: NDArray[np.floating]) -> NDArray[np.float32]:
        """`uncertainty` (n,) at vertices (n, 3)."""
        return self.uncertainty(vertices)

    def probability_volume(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy probability (nx, ny, nz) on a grid of camera-frame coordinates, metres."""
        return mean_occupancy(self.logit_volume(axes))

    def logit_volume(self, axes: Axes) -> NDArray[np.float32]:
        """w . phi (P, nx, ny, nz) on a grid of camera-frame coordinates, metres."""
        local = tuple(
            torch.from_numpy((np.asarray(axis, np.float64) - middle).astype(np.float32))
            for axis, middle in zip(axes, self.center, strict=True)
        )
        logits = grid_logits(
            torch.from_numpy(self.weights), (local[0], local[1], local[2]), self.grid
        )
        return np.asarray(logits.numpy())

    def particle_volumes(self, axes: Axes) -> NDArray[np.float32]:
        """Occupancy probability (P, nx, ny, nz) of each particle on a grid."""
        return occupancy(self.logit_volume(axes))

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """Attributes center (3), reach, hinge_lower (3), hinge_counts (3), hinge_spacing and
        feature_floor; weights (P, H + 1) float32."""
        group.attrs["center"] = self.center
        group.attrs["reach"] = self.reach
        group.attrs["hinge_lower"] = self.grid.lower
        group.attrs["hinge_counts"] = self.grid.counts
        group.attrs["hinge_spacing"] = self.grid.spacing
        group.attrs["feature_floor"] = self.grid.floor
        group.create_dataset(
            "weights", data=self.weights, chunks=self.weights.shape, fletcher32=True
        )

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> HilbertPosterior:
        """What `write` wrote. Errors: KeyError, ValueError."""
        attributes = group.attrs
        x, y, z = (float(v) for v in attributes["hinge_lower"])
        nx, ny, nz = (int(n) for n in attributes["hinge_counts"])
        return HilbertPosterior(
            weights=np.asarray(group["weights"], dtype=np.float32),
            center=np.asarray(attributes["center"], dtype=np.float64),
            grid=HingeGrid(
                (x, y, z),
                (nx, ny, nz),
                float(attributes["hinge_spacing"]),
                float(attributes["feature_floor"]),
            ),
            reach=float(attributes["reach"]),
        )


def occupancy(logits: NDArray[np.floating]) -> NDArray[np.float32]:
    """sigmoid(logits), of the same shape."""
    return np.asarray(torch.sigmoid(torch.from_numpy(logits)).numpy())


def mean_occupancy(logits: NDArray[np.floating]) -> NDArray[np.float32]:
    """Mean over the first axis (particles) of sigmoid(logits)."""
    return np.asarray(torch.sigmoid(torch.from_numpy(logits)).mean(dim=0).numpy())
