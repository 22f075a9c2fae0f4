"""A table of which much has no depth, as of black or shiny ones: things tell how far it goes.

What reaches down to the table's height, where nothing is seen behind the plane between it and the
part that has depth, and most is without depth, stands on the table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.table import BareConfig
from brrp_cli.dependencies import import_library
from brrp_cli.hulls import convex_hull, in_hull

Mask = NDArray[np.bool_]

# Enough pixels to tell what is seen of a part of a plane.
EVERY = np.s_[::2, ::2]


@dataclass(frozen=True)
class Seen:
    """What is seen of a plane and over it.

    points : (H, W, 3) metres, camera frame, NaN = no depth; plan : (H, W, 2) metres, on the plane;
    height : (H, W) metres above it; crossing : (H, W, 2) metres, where sight crosses it, NaN where
    it does not
    """

    points: NDArray[np.floating]
    plan: NDArray[np.float64]
    height: NDArray[np.float64]
    crossing: NDArray[np.float64]


def with_things_beside(
    hull: NDArray[np.float64], flat: Mask, off: Mask, seen: Seen, config: BareConfig
) -> NDArray[np.float64]:
    """The hull (m, 3) of a table, as far as what stands beside it shows that it goes on there.

    flat : (H, W) its pixels; off : (H, W) those that walls shut off
    """
    on = seen.plan[flat]
    crossing = seen.crossing[EVERY].reshape(-1, 2)
    lacks = ~np.isfinite(seen.height[EVERY]).ravel()
    behind = (seen.height[EVERY] < -config.off).ravel()
    for thing in _things(hull, off, seen, config):
        if in_hull(hull, thing, 0.0).mean() > config.inside:
            continue
        both = np.concatenate([on, thing])
        grown = convex_hull(both)
        if grown is None:
            continue
        between = in_hull(grown, crossing, 0.0) & ~in_hull(hull, crossing, 0.0)
        through, bare = (int(each[between].sum()) for each in (behind, lacks))
        if through <= config.through * bare and bare >= config.bare * between.sum():
            on, hull = both, grown
    return hull


def _things(
    hull: NDArray[np.float64], off: Mask, seen: Seen, config: BareConfig
) -> list[NDArray[np.float64]]:
    """Plan points (n, 2) of each thing that reaches down to the plane, or stands partly within the
    hull: those nearest to it first."""
    ndimage = import_library("scipy.ndimage")
    rises = (seen.height > config.rises) & (seen.height < config.high) & ~off
    labels, _ = ndimage.label(rises & ~_jumps(seen.points, config.jump))
    things = []
    for label, window in enumerate(ndimage.find_objects(labels), start=1):
        mine = labels[window] == label
        if mine.sum() < config.pixels:
            continue
        plan = seen.plan[window][mine]
        within = in_hull(hull, plan, 0.0).mean()
        lowest = np.percentile(seen.height[window][mine], config.lowest)
        if within > config.partly or lowest < config.foot:
            # Bled pixels lie far behind.
            low, high = np.percentile(plan, (config.bled, 100 - config.bled), axis=0)
            things.append((-within, plan[((plan >= low) & (plan <= high)).all(axis=-1)]))
    return [plan for _, plan in sorted(things, key=lambda pair: pair[0])]


def _jumps(points: NDArray[np.floating], jump: float) -> Mask:
    """(H, W) pixels beside which depth jumps by more than `jump` metres."""
    depth = points[..., 2]
    jumps = np.zeros(depth.shape, dtype=bool)
    for axis in (0, 1):
        near, marked = np.moveaxis(depth, axis, 0), np.moveaxis(jumps, axis, 0)
        with np.errstate(invalid="ignore"):
            steep = np.abs(near[1:] - near[:-1]) > jump
        marked[1:] |= steep
        marked[:-1] |= steep
    return jumps
