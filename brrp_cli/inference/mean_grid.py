"""A prior mean function that is kept on a grid: that of a completed shape."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from brrp_cli.geometry import grid_nodes, inverse, moved_box, transform_points
from brrp_cli.hdf5 import stored_motion, write_compressed
from brrp_cli.reconstruction import Axes

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts

Array = NDArray[np.float64]
_AXES = range(3)


@dataclass(frozen=True)
class MeanGrid:
    """Logits at the nodes lower + spacing * (i, j, k), metres, in the grid's frame.

    lower : (3,); spacing : > 0; values : (nx, ny, nz) float16; outside : logit off the grid
    T_cam_grid : (4, 4) rigid, from the grid's frame; None where that is the camera frame
    """

    kind: ClassVar[str] = "grid"

    lower: Array
    spacing: float
    values: NDArray[np.float16]
    outside: float
    T_cam_grid: Array | None = None

    @property
    def bounds(self) -> Array:
        """(2, 3) metres, camera frame: around the first and the last node."""
        upper = self.lower + self.spacing * (np.array(self.values.shape) - 1)
        box = np.stack([self.lower, upper])
        return box if self.T_cam_grid is None else moved_box(self.T_cam_grid, box)

    def moved(self, T_target_cam: Array) -> MeanGrid:
        """The same in another frame, which T_target_cam (4, 4), rigid, leads to."""
        T = T_target_cam if self.T_cam_grid is None else T_target_cam @ self.T_cam_grid
        return replace(self, T_cam_grid=T)

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m (n,) at points (n, 3), metres, camera frame; trilinear."""
        points = np.asarray(points, dtype=np.float64)
        if self.T_cam_grid is not None:
            points = transform_points(inverse(self.T_cam_grid), points)
        at = ((points - self.lower) / self.spacing).T
        values = self.values.astype(np.float32)
        return np.asarray(map_coordinates(values, at, order=1, mode="constant", cval=self.outside))

    def volume(self, axes: Axes) -> NDArray[np.float32]:
        """m (nx, ny, nz) on a grid along the camera's axes, metres: `logits` one axis after the
        other, a tenth of the steps, where these are the grid's axes, too."""
        if self.T_cam_grid is not None:
            nodes = grid_nodes(axes)
            return self.logits(nodes.reshape(-1, 3)).reshape(nodes.shape[:3])
        values = self.values.astype(np.float32)
        within = []
        for number, axis in enumerate(axes):
            last = values.shape[number] - 1
            at = (np.asarray(axis, dtype=np.float64) - self.lower[number]) / self.spacing
            within.append((at >= 0) & (at <= last))
            low = np.clip(np.floor(at).astype(np.int64), 0, max(last - 1, 0))
            share = (at - low).astype(np.float32).reshape([-1 if i == number else 1 for i in _AXES])
            below, above = values.take(low, number), values.take(np.minimum(low + 1, last), number)
            above -= below
            above *= share
            above += below
            values = above
        inside = within[0][:, None, None] & within[1][:, None] & within[2]
        return np.where(inside, values, np.float32(self.outside))

    def write(self, group: h5py.Group, shared: SharedParts) -> None:
        """Attributes lower (3), spacing, outside, T_cam_grid (4, 4) where there is one; values (nx,
        ny, nz) float16."""
        if self.T_cam_grid is not None:
            group.attrs["T_cam_grid"] = self.T_cam_grid
        group.attrs.update({"lower": self.lower, "spacing": self.spacing, "outside": self.outside})
        write_compressed(group, "values", self.values)

    @classmethod
    def read(cls, group: h5py.Group, shared: SharedParts) -> MeanGrid:
        """What `write` wrote. Errors: KeyError, ValueError."""
        return MeanGrid(
            lower=np.asarray(group.attrs["lower"], dtype=np.float64),
            spacing=float(group.attrs["spacing"]),
            values=np.asarray(group["values"], dtype=np.float16),
            outside=float(group.attrs["outside"]),
            T_cam_grid=stored_motion(group.attrs, "T_cam_grid"),
        )


def grid_over(box: Array, nodes: int) -> tuple[Array, float, Array]:
    """Lower node (3,), spacing and nodes (nx, ny, nz, 3) of a grid over a box (2, 3) with about
    `nodes` nodes."""
    spacing = float((np.prod(box[1] - box[0]) / nodes) ** (1 / 3))
    shape = np.ceil((box[1] - box[0]) / spacing).astype(np.int64) + 1
    axes = [low + spacing * np.arange(n) for low, n in zip(box[0], shape, strict=True)]
    return box[0].copy(), spacing, grid_nodes(axes)
