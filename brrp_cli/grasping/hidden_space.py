"""Space behind what stands around the objects: nobody knows what is there, as over a shelf's board
of which the camera sees the front edge alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import SurroundingsConfig

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HiddenSpace:
    """What lies behind observed points, as seen by the camera.

    depth : (H, W) metres along z beyond which space is hidden, infinite where nothing hides it; of
    an image whose first cell begins at `first` (2,), x / z and y / z, with cells of `cell`
    """

    depth: Array
    first: Array
    cell: float

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """(...,) which of points (..., 3), metres, camera frame, are hidden."""
        height, width = self.depth.shape
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.floor((points[..., :2] / points[..., 2:] - self.first) / self.cell)
        inside = (points[..., 2] > 0) & ((at >= 0) & (at < [width, height])).all(axis=-1)
        hidden = np.zeros(inside.shape, dtype=bool)
        column, row = at[inside].astype(np.int64).T
        hidden[inside] = points[inside][:, 2] > self.depth[row, column]
        return hidden


def hidden_behind(around: Array, config: SurroundingsConfig) -> HiddenSpace:
    """The space behind points (n, 3), metres, camera frame, of what stands around."""
    if not len(around):
        return HiddenSpace(np.zeros((0, 0)), np.zeros(2), config.angle)
    seen = around[:, :2] / around[:, 2:]
    first = seen.min(axis=0)
    at = np.floor((seen - first) / config.angle).astype(np.int64)
    width, height = at.max(axis=0) + 1
    depth = np.full((height, width), np.inf)
    np.minimum.at(depth, (at[:, 1], at[:, 0]), around[:, 2] + config.behind)
    return HiddenSpace(depth, first, config.angle)


NOTHING_HIDDEN = hidden_behind(np.zeros((0, 3)), SurroundingsConfig())
