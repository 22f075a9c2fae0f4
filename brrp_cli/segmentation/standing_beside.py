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
from brrp_cli.geometry import backproject, within
from brrp_cli.hulls import convex_hull, in_hull
from brrp_cli.segmentation.concave_edges import depth_steps
from brrp_cli.segmentation.table_plane import Table

Mask = NDArray[np.bool_]

# Enough pixels to tell what is seen of a part of a plane.
EVERY = np.s_[::2, ::2]


@dataclass(frozen=True)
class Seen:
    """What is seen of a table and over it.

    points : (H, W, 3) metres, camera frame, NaN = no depth; plan : (H, W, 2) metres, on the table;
    height : (H, W) metres above it; beside : (H, W) metres beside its hull; off : (H, W) pixels
    that walls shut off; K : (3, 3) of the camera
    """

    table: Table
    points: NDArray[np.floating]
    plan: NDArray[np.float64]
    height: NDArray[np.float64]
    beside: NDArray[np.float64]
    off: Mask
    K: NDArray[np.floating]

    def crossing(self) -> NDArray[np.float64]:
        """(n, 2) metres, where every pixel of `EVERY` looks at the table's plane; NaN if not."""
        sight = backproject(np.ones(self.height.shape), self.K)[EVERY].reshape(-1, 3)
        return self.table.plan(self.table.plane.met_by(sight))


def with_things_beside(seen: Seen, tolerance: float, config: BareConfig) -> NDArray[np.float64]:
    """The hull (m, 3) of a table, as far as what stands beside it shows that it goes on there.

    tolerance : metres within which something is the table
    """
    hull = seen.table.hull
    rises = (seen.height > config.rises) & (seen.height < config.high) & ~seen.off
    if (rises & (seen.beside > 0)).sum() < config.pixels:
        return hull
    on = seen.plan[(np.abs(seen.height) < tolerance) & (seen.beside <= 0)]
    crossing = seen.crossing()
    lacks = ~np.isfinite(seen.height[EVERY]).ravel()
    behind = (seen.height[EVERY] < -config.off).ravel()
    for thing in _things(rises, seen, config):
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


def _things(rises: Mask, seen: Seen, config: BareConfig) -> list[NDArray[np.float64]]:
    """Plan points (n, 2) of each thing that reaches down to the table, or stands partly on what is
    seen of it: those first of which most does. rises : (H, W) pixels of things"""
    ndimage = import_library("scipy.ndimage")
    steps = depth_steps(seen.points[..., 2], (config.jump, config.jump))
    labels, _ = ndimage.label(rises & ~steps)
    things = []
    for label, window in enumerate(ndimage.find_objects(labels), start=1):
        mine = labels[window] == label
        if mine.sum() < config.pixels:
            continue
        plan = seen.plan[window][mine]
        inside = (seen.beside[window][mine] <= 0).mean()
        lowest = np.percentile(seen.height[window][mine], config.lowest)
        if inside > config.partly or lowest < config.foot:
            # Bled pixels lie far behind.
            low, high = np.percentile(plan, (config.bled, 100 - config.bled), axis=0)
            things.append((-inside, plan[within(plan, low, high)]))
    return [plan for _, plan in sorted(things, key=lambda pair: pair[0])]
