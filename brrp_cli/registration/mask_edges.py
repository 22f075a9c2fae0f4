"""Outlines that pull: a placed shape reaches as far as the object's mask in the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.seen_mask import SeenMaskConfig
from brrp_cli.frames.dilate import dilated, mask_box
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.geometry import transform_points
from brrp_cli.registration.mask_loops import NEAREST

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MaskEdges:
    """How far a mask reaches where nothing hides the object: `reach` (d,) pixels along `directions`
    (d, 2) of the image; K : (3, 3); deviation : pixels, by which it errs"""

    reach: Array
    directions: Array
    K: Array
    deviation: float

    def gaps(self, T_cam_shape: Array, vertices: Array, middle: Array) -> tuple[Array, Array]:
        """Pixels (d,) from where a shape (n, 3), placed by T_cam_shape (4, 4), reaches to the edge
        of the mask; and (d, 6), pixels for a radian of a turn about `middle` (3,) and a metre of a
        shift, by which such motions move the shape's reach."""
        placed = np.asarray(transform_points(T_cam_shape, vertices), dtype=np.float64)
        z = np.maximum(placed[:, 2], NEAREST)
        focal = np.array([self.K[0, 0], self.K[1, 1]])
        pixels = placed[:, :2] / z[:, None] * focal + self.K[:2, 2]
        along = pixels @ self.directions.T
        first = along.argmax(axis=0)
        gap = self.reach - along[first, np.arange(len(first))]
        x, depth = placed[first], z[first]
        # Of the pixel's place along the direction, by the point's place in space.
        by_point = np.empty((len(first), 3))
        by_point[:, :2] = self.directions * focal / depth[:, None]
        by_point[:, 2] = -(by_point[:, :2] * x[:, :2]).sum(axis=1) / depth
        return gap, np.concatenate([np.cross(x - middle, by_point), by_point], axis=1)


def mask_edges(frame: Frame, object_id: int, config: SeenMaskConfig) -> MaskEdges:
    """Those of an object of the frame that nothing may cut."""
    by_mask = config.by_mask
    directions = around(by_mask.directions)
    reach, cut = reach_of(frame, object_id, directions, by_mask.edge_width)
    return MaskEdges(
        reach[~cut], directions[~cut], frame.K.astype(np.float64), config.edge_deviation
    )


def around(count: int) -> Array:
    """(count, 2) directions of the image, evenly spread."""
    angle = np.arange(count) * (2 * np.pi / count)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def reach_of(
    frame: Frame, object_id: int, directions: Array, width: int
) -> tuple[Array, NDArray[np.bool_]]:
    """How far an object's mask reaches along directions (d, 2), pixels (d,), and where it may go on
    (d,): it is cut there by the image's border or by another object, within `width` pixels."""
    mask = frame.segmap == object_id
    rows, columns = np.nonzero(mask)
    along = np.stack([columns, rows], axis=1) @ directions.T
    reach = along.max(axis=0)
    beside = _beside_others(frame, mask, width)[rows, columns]
    cut = [bool(beside[far].any()) for far in (along > reach - width).T]
    return reach, np.array(cut)


def _beside_others(frame: Frame, mask: NDArray[np.bool_], width: int) -> NDArray[np.bool_]:
    """(H, W) pixels of a mask near the image's border, or near another object."""
    found, box = np.zeros_like(mask), mask_box(mask, width)
    others = (frame.segmap[box] != BACKGROUND) & ~mask[box]
    found[box] = dilated(others, width)
    found[:width] = found[-width:] = True
    found[:, :width] = found[:, -width:] = True
    return found & mask
