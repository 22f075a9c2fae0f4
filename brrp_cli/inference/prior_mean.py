"""Prior mean functions of a Hilbert map: what a hypothesis says before the observation corrects it.

A hypothesis about an object is a logit of occupancy m(x). With it the map is
sigmoid(m(x) + w . phi(x)): the weights are left with what the hypothesis does not explain, and a
thin wall needs no hinge points of its own. Each m is kept on a grid in the camera frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, map_coordinates, maximum_filter, minimum_filter

from brrp_cli.completion.network import fitted
from brrp_cli.completion.point_features import point_features
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.config import MeanConfig
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.observation.support_plane import Plane
from brrp_cli.reconstruction import Axes

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class PriorMeanGrid:
    """Logits at the nodes lower + spacing * (i, j, k), metres, camera frame, of C hypotheses.

    lower : (3,); spacing : > 0; values : (C, nx, ny, nz) float16; outside : logit off the grid
    """

    lower: Array
    spacing: float
    values: NDArray[np.float16]
    outside: float

    @property
    def upper(self) -> Array:
        """(3,), the last node."""
        return np.asarray(self.lower + self.spacing * (np.array(self.values.shape[1:]) - 1))

    def logits(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """(C, n) at points (n, 3), metres, camera frame; trilinear."""
        at = ((np.asarray(points, dtype=np.float64) - self.lower) / self.spacing).T
        return np.stack(
            [
                map_coordinates(
                    each.astype(np.float32), at, order=1, mode="constant", cval=self.outside
                )
                for each in self.values
            ]
        )

    def volume(self, axes: Axes) -> NDArray[np.float32]:
        """(C, nx, ny, nz) on another grid along the camera's axes."""
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        found = self.logits(nodes.reshape(-1, 3))
        return found.reshape(-1, *nodes.shape[:3])


def grid_over(box: Array, config: MeanConfig) -> tuple[Array, float, Array]:
    """Lower node (3,), spacing and nodes (nx, ny, nz, 3) of a grid over a box (2, 3) with about
    `config.nodes` nodes."""
    spacing = float((np.prod(box[1] - box[0]) / config.nodes) ** (1 / 3))
    shape = np.ceil((box[1] - box[0]) / spacing).astype(np.int64) + 1
    axes = [low + spacing * np.arange(n) for low, n in zip(box[0], shape, strict=True)]
    return box[0].copy(), spacing, np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def shape_logits(distance: Array, alignment_score: float, config: MeanConfig) -> Array:
    """Logits of a placed shape, from signed distances, metres: -(d - growth) / width, limited.

    The less the frame says for the placement, the softer its surface.
    """
    width = config.width + config.doubt * max(0.0, config.sure - alignment_score)
    logits = np.clip((config.growth - distance) / width, -config.limit, config.limit)
    return np.asarray(logits)


def completed_grid(
    nodes: Array, empty: NDArray[np.bool_], part: VisiblePart, config: MeanConfig
) -> NDArray[np.float16]:
    """Logits (nx, ny, nz) at nodes (nx, ny, nz, 3), metres, camera frame, of an object that is none
    of the stored ones; the least where it is empty.

    The network is asked at every second node along each axis, and at the nodes between where those
    around are neither all out of doubt (`beyond_doubt`) inside nor all outside.
    """
    near = binary_dilation(~empty, np.ones((3, 3, 3), bool))
    # One node more at the end where the last one would have none after it.
    odd = np.pad(near, [(0, 1 - n % 2) for n in near.shape])[::2, ::2, ::2]
    steps = [np.arange(n) * 2 for n in odd.shape]
    at = nodes[0, 0, 0] + (nodes[1, 1, 1] - nodes[0, 0, 0]) * np.stack(
        np.meshgrid(*steps, indexing="ij"), axis=-1
    )
    asked = np.full(odd.shape, -config.limit, np.float32)
    asked[odd] = _network(at[odd], part)
    doubtful = (maximum_filter(asked, 3) > -config.beyond_doubt) & (
        minimum_filter(asked, 3) < config.beyond_doubt
    )
    for axis, count in enumerate(empty.shape):
        asked = _doubled(asked, axis, count)
        doubtful = doubtful.repeat(2, axis=axis).take(np.arange(count), axis=axis)
    doubtful &= ~empty
    asked[doubtful] = _network(nodes[doubtful], part)
    logits = np.full(empty.shape, -config.limit, np.float16)
    logits[~empty] = _with_crust(asked[~empty], nodes[~empty], part, config)
    return logits


def _network(points: Array, part: VisiblePart) -> Floats:
    return fitted().logits(point_features(points, part)) if len(points) else np.empty(0, np.float32)


def _doubled(values: Floats, axis: int, count: int) -> Floats:
    """The first `count` of values along an axis with the mean of each two between them."""
    first = np.moveaxis(values, axis, 0)
    found = np.empty((2 * len(first) - 1, *first.shape[1:]), values.dtype)
    found[::2] = first
    found[1::2] = (first[:-1] + first[1:]) / 2
    return np.moveaxis(found[:count], 0, axis)


def _with_crust(logits: Floats, points: Array, part: VisiblePart, config: MeanConfig) -> Array:
    """The network's logits (n,) at points (n, 3), limited. What was seen has some thickness,
    however thin the walls are that the network thinks of."""
    limited = np.clip(logits, -config.limit, config.limit)
    behind = -depth_behind(points, part.frame)
    own = at_pixels(points, part.frame.segmap, part.frame) == part.object_id
    shell = (
        own & (np.nan_to_num(behind, nan=np.inf) < config.shell) & (behind > -config.shell_before)
    )
    return np.where(shell, np.maximum(limited, config.shell_logit), limited)


def empty_space(
    points: Array, frame: Frame, object_id: int, plane: Plane | None, config: MeanConfig
) -> NDArray[np.bool_]:
    """Which of `points` (n, 3), metres, camera frame, cannot be in the object.

    Space in front of the measured depth; space below the plane; and, since the object would hide
    it, space close to a surface that is no object's.
    """
    behind = depth_behind(points, frame)
    empty = np.nan_to_num(behind, nan=-np.inf) > config.carve_depth
    if plane is not None:
        empty |= plane.signed_distance(points) < -config.carve_plane
    own = binary_dilation(frame.segmap == object_id, iterations=config.carve_pixels)
    background = np.where((frame.segmap == BACKGROUND) & ~own, 1, 0)
    close = np.nan_to_num(behind, nan=-np.inf) > -config.carve_behind
    return empty | (close & (at_pixels(points, background, frame) == 1))
