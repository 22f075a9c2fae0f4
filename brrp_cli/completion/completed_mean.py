"""The prior mean function of an object that none of the stored ones explains, and the space that it
cannot be in.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, maximum_filter, minimum_filter

from brrp_cli.completion.network import fitted
from brrp_cli.completion.point_features import point_features
from brrp_cli.completion.seen_surface import Bounds
from brrp_cli.completion.usual_size import of_usual_size
from brrp_cli.completion.visible_part import VisiblePart
from brrp_cli.config import MeanConfig
from brrp_cli.frames.dilate import dilated
from brrp_cli.frames.frame import BACKGROUND, Frame
from brrp_cli.frames.projection import at_pixels, depth_behind
from brrp_cli.geometry import grid_nodes
from brrp_cli.observation.support_plane import Plane

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


def network_grid(
    nodes: Array, empty: NDArray[np.bool_], part: VisiblePart, config: MeanConfig
) -> Floats:
    """What the network thinks (nx, ny, nz) at nodes (nx, ny, nz, 3); anything where it is empty.

    The network is asked at every second node along each axis, and at the nodes between where those
    around are neither all out of doubt (`beyond_doubt`) inside nor all outside.
    """
    near = binary_dilation(~empty, np.ones((3, 3, 3), bool))
    # One node more at the end where the last one would have none after it.
    odd = np.pad(near, [(0, 1 - n % 2) for n in near.shape])[::2, ::2, ::2]
    steps = [np.arange(n) * 2 for n in odd.shape]
    at = nodes[0, 0, 0] + (nodes[1, 1, 1] - nodes[0, 0, 0]) * grid_nodes(steps)
    thinks = _network(part)
    asked = np.full(odd.shape, -config.limit, np.float32)
    asked[odd] = thinks(at[odd])
    doubtful = (maximum_filter(asked, 3) > -config.beyond_doubt) & (
        minimum_filter(asked, 3) < config.beyond_doubt
    )
    for axis, count in enumerate(empty.shape):
        asked = _doubled(asked, axis, count)
        doubtful = doubtful.repeat(2, axis=axis).take(np.arange(count), axis=axis)
    doubtful &= ~empty
    # These have been asked.
    doubtful[::2, ::2, ::2] = False
    asked[doubtful] = thinks(nodes[doubtful])
    return asked


def logits_within(
    guess: Floats, empty: NDArray[np.bool_], bounds: Bounds, config: MeanConfig
) -> NDArray[np.float16]:
    """Logits (nx, ny, nz), limited: the network's `guess` (nx, ny, nz), the least where it is
    empty. What was seen, the bounds (n,) of the nodes that are not empty, is where it was seen."""
    logits = np.full(empty.shape, -config.limit, np.float16)
    logits[~empty] = bounds.applied(np.clip(guess[~empty], -config.limit, config.limit))
    return logits


def shell_of(nodes: Array, config: MeanConfig) -> float:
    """Metres, how thick what was seen is on a grid of nodes (nx, ny, nz, 3)."""
    spacing = float(np.linalg.norm(nodes[1, 0, 0] - nodes[0, 0, 0]))
    return max(config.shell, config.shell_nodes * spacing)


def _network(part: VisiblePart) -> Callable[[Array], Floats]:
    """Log odds (n,) at points (n, 3), by the network that the configuration chooses."""
    part, scale = of_usual_size(part)
    if part.config.learned:
        # torch takes its time to load.
        from brrp_cli.completion.learned import LearnedShape, shapes

        learned = LearnedShape(part, part.config.volume, shapes())
        return lambda points: learned.logits(points * scale)

    def from_lengths(points: Array) -> Floats:
        if not len(points):
            return np.empty(0, np.float32)
        return fitted().logits(point_features(points * scale, part))

    return from_lengths


def _doubled(values: Floats, axis: int, count: int) -> Floats:
    """The first `count` of values along an axis with the mean of each two between them."""
    first = np.moveaxis(values, axis, 0)
    found = np.empty((2 * len(first) - 1, *first.shape[1:]), values.dtype)
    found[::2] = first
    found[1::2] = (first[:-1] + first[1:]) / 2
    return np.moveaxis(found[:count], 0, axis)


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
    own = dilated(frame.segmap == object_id, config.carve_pixels)
    background = np.where((frame.segmap == BACKGROUND) & ~own, 1, 0)
    close = np.nan_to_num(behind, nan=-np.inf) > -config.carve_behind
    return empty | (close & (at_pixels(points, background, frame) == 1))
