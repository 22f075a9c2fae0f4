"""The posterior of one object's shape: particles over Hilbert-map weights, asked at points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from brrp_cli.geometry import as_points, grid_nodes, inverse, moved_box, transform_points
from brrp_cli.hdf5 import stored_motion
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

    weights : (P, H + 1) float32; center : (3,) float64, metres, centre of the hinge grid, which
    lies along the axes of the map's frame; reach : half-width of the cube in which samples
    constrained the map, metres
    T_cam_map : (4, 4) rigid, from the map's frame, in which it was inferred; None where that is the
    camera frame
    """

    kind: ClassVar[str] = "hilbert_map"

    weights: NDArray[np.float32]
    center: NDArray[np.float64]
    grid: HingeGrid
    reach: float
    T_cam_map: NDArray[np.float64] | None = None

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) metres, camera frame: around the cube outside of which no sample was drawn."""
        cube = np.stack([self.center - self.reach, self.center + self.reach])
        return cube if self.T_cam_map is None else moved_box(self.T_cam_map, cube)

    def moved(self, T_target_cam: NDArray[np.float64]) -> HilbertPosterior:
        """The same in another frame, which T_target_cam (4, 4), rigid, leads to."""
        T = T_target_cam if self.T_cam_map is None else T_target_cam @ self.T_cam_map
        return replace(self, T_cam_map=T)

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """w . phi (P, n) at points (n, 3), metres, camera frame. Errors: BrrpError."""
        points = as_points(points).astype(np.float64)
        if self.T_cam_map is not None:
            points = transform_points(inverse(self.T_cam_map), points)
        # Centre in float64: kernels of centimetres leave no room for float32 far from the origin.
        local = torch.from_numpy((points - self.center).astype(np.float32))
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
        if self.T_cam_map is not None:
            nodes = grid_nodes(axes)
            return self.logits(nodes.reshape(-1, 3)).reshape(-1, *nodes.shape[:3])
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
        feature_floor, T_cam_map (4, 4) where there is one; weights (P, H + 1) float32."""
        if self.T_cam_map is not None:
            group.attrs["T_cam_map"] = self.T_cam_map
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
            T_cam_map=stored_motion(attributes, "T_cam_map"),
        )


def occupancy(logits: NDArray[np.floating]) -> NDArray[np.float32]:
    """sigmoid(logits), of the same shape."""
    return np.asarray(torch.sigmoid(torch.from_numpy(logits)).numpy())


def mean_occupancy(logits: NDArray[np.floating]) -> NDArray[np.float32]:
    """Mean over the first axis (particles) of sigmoid(logits)."""
    return np.asarray(torch.sigmoid(torch.from_numpy(logits)).mean(dim=0).numpy())
