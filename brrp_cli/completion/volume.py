"""What a frame shows around one object, as a volume that stands on the support plane.

A cube of `side`^3 voxels, its axes along `across`, `ahead` and up, so that every object is looked
at from the same side. The lengths of point_features.py say what is known at one point; a volume
says what is known everywhere at once, from which a network can tell one shape from another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.config import VolumeConfig
from brrp_cli.frames.frame import BACKGROUND
from brrp_cli.frames.projection import pixel_numbers

Array = NDArray[np.float64]

# Channels, each between -1 and 1: depth behind what was measured, cut off at `near` voxels and at
# half of the cube; whether the pixel is the object's, another one's, without depth; pixels within
# the silhouette; observed points; height.
CHANNELS = 8


@dataclass(frozen=True)
class Volume:
    """values : (CHANNELS, n, n, n) int8, 127 for 1, along across, ahead and up

    origin : (3,) the corner where all three are least, metres, camera frame; axes : (3, 3) unit
    rows across, ahead, up; edge : metres
    """

    values: NDArray[np.int8]
    origin: Array
    axes: Array
    edge: float

    def places(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """(n, 3) of points (n, 3), metres, camera frame: from -1 at one side of the cube to 1 at
        the other."""
        along = (points - self.origin) @ self.axes.T
        return np.asarray(along / (self.edge / 2) - 1, dtype=np.float32)


def volume_of(part: VisiblePart, config: VolumeConfig) -> Volume:
    """The volume around what is seen of an object."""
    frame, count = part.frame, config.side
    axes = np.stack([part.across, part.ahead, part.up])
    low, size = _bounds(part, axes, config)
    edge = float(size.max())
    voxel = edge / count
    middle = low + size / 2
    # It stands on the plane: what it has to spare is above.
    start = np.array([*(middle[:2] - edge / 2), low[2]])
    origin = start @ axes
    steps = (np.arange(count) + 0.5) * voxel
    centres = (
        origin
        + (steps[:, None, None, None] * axes[0] + steps[:, None, None] * axes[1])
        + steps[:, None] * axes[2]
    ).reshape(-1, 3)
    pixel, visible = pixel_numbers(centres, frame)
    label = np.where(visible, frame.segmap.ravel()[pixel], BACKGROUND)
    measured = frame.depth.ravel()[pixel]
    known = visible & np.isfinite(measured)
    behind = np.where(known, centres[:, 2] - np.where(known, measured, 0), 0.0)
    own = label == part.object_id
    metres = np.where(visible, centres[:, 2] / frame.K[0, 0], 0.0)
    within = part.silhouette.ravel()[pixel] * metres
    cells = np.floor(((part.seen @ axes.T) - start) / voxel).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < count)).all(axis=1)]
    seen = np.bincount(np.ravel_multi_index(tuple(cells.T), (count,) * 3), minlength=count**3)
    height = np.tile(steps + (low[2] - _floor(part, axes)), count**2) / edge
    channels = [
        behind / (config.near * voxel),
        behind / (edge / 2),
        own,
        visible & ~own & (label != BACKGROUND),
        ~known,
        within / (edge / 4),
        seen / config.full,
        height,
    ]
    values = np.stack([np.clip(np.asarray(one) * 127.0, -127, 127) for one in channels])
    shape = (CHANNELS, count, count, count)
    return Volume(np.rint(values).astype(np.int8).reshape(shape), origin, axes, edge)


def _bounds(part: VisiblePart, axes: Array, config: VolumeConfig) -> tuple[Array, Array]:
    """Lower corner and size (3,), metres, along `axes`, of what the object is likely to fill, with
    room for what is hidden behind its front, and behind what stands before it."""
    low, high = np.quantile(part.seen @ axes.T, part.config.most, axis=0)
    # As deep as wide, as if it were round; a side that is hidden leaves the other to go by.
    high[1] = max(high[1], low[1] + config.depth * (high[0] - low[0]))
    low[2] = min(low[2], _floor(part, axes))
    size = np.maximum(high - low, part.config.least)
    room = (config.margin + config.hidden * _hidden(part)) * size.max()
    low[:2] -= room
    size[:2] += 2 * room
    low[2] -= config.below * size.max()
    size[2] += (config.below + config.margin) * size.max()
    return low, size


def _floor(part: VisiblePart, axes: Array) -> float:
    """How high the plane lies along up, metres; the lowest point seen, where there is none."""
    if part.plane is None:
        return float(np.quantile(part.seen @ axes[2], part.config.most[0]))
    return -part.plane.offset


def _hidden(part: VisiblePart) -> float:
    """Share of the pixels around the mask that are another object's, which stands before it, or lie
    at the image's edge."""
    frame = part.frame
    own = np.pad(frame.segmap == part.object_id, 1)
    rows, columns = np.nonzero(own)
    window = tuple(
        slice(max(0, int(each.min()) - 2), int(each.max()) + 3) for each in (rows, columns)
    )
    own = own[window]
    ring = binary_dilation(own) & ~own
    depth = np.pad(np.nan_to_num(frame.points[..., 2]), 1)[window]
    other = np.pad(frame.segmap, 1, constant_values=-1)[window]
    nearer = depth < np.median(part.seen[:, 2])
    before = ring & ((other == -1) | ((other != BACKGROUND) & nearer))
    return float(before.sum() / max(1, ring.sum()))
