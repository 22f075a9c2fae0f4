"""A prior mean function that is kept on a grid in the camera frame: that of a completed shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from brrp_cli.hdf5 import write_compressed
from brrp_cli.reconstruction import Axes

if TYPE_CHECKING:
    import h5py

    from brrp_cli.hdf5 import SharedParts

Array = NDArray[np.float64]
_AXES = range(3)


@dataclass(frozen=True)
class MeanGrid:
    """Logits at the nodes lower + spacing * (i, j, k), metres, camera frame.

    lower : (3,); spacing : > 0; values : (nx, ny, nz) float16; outside : logit off the grid
    """

    kind: ClassVar[str] = "grid"

    lower: Array
    spacing: float
    values: NDArray[np.float16]
    outside: float

    @property
    def bounds(self) -> Array:
        """(2, 3) metres, camera frame: the first and the last node."""
        upper = self.lower + self.spacing * (np.array(self.values.shape) - 1)
        return np.stack([self.lower, upper])

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """m (n,) at points (n, 3), metres, camera frame; trilinear."""
        at = ((np.asarray(points, dtype=np.float64) - self.lower) / self.spacing).T
        values = self.values.astype(np.float32)
        return np.asarray(map_coordinates(values, at, order=1, mode="constant", cval=self.outside))

    def volume(self, axes: Axes) -> NDArray[np.float32]:
        """m (nx, ny, nz) on a grid along the camera's axes, metres: `logits` one axis after the
        other, a tenth of the steps."""
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
        """Attributes lower (3), spacing, outside; values (nx, ny, nz) float16."""
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
        )


def grid_over(box: Array, nodes: int) -> tuple[Array, float, Array]:
    """Lower node (3,), spacing and nodes (nx, ny, nz, 3) of a grid over a box (2, 3) with about
    `nodes` nodes."""
    spacing = float((np.prod(box[1] - box[0]) / nodes) ** (1 / 3))
    shape = np.ceil((box[1] - box[0]) / spacing).astype(np.int64) + 1
    axes = [low + spacing * np.arange(n) for low, n in zip(box[0], shape, strict=True)]
    return box[0].copy(), spacing, np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
