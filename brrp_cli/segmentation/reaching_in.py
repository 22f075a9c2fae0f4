"""What reaches in over the table from outside the image, through the air: a robot's arm, a hand.

It hangs together with the image's border and ends above the table. Parts of it are taken away
before parts are joined: what lies far above a thing looks, from above, as if it stood in it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.segmentation import ReachingInConfig, SegmentConfig
from brrp_cli.dependencies import import_library
from brrp_cli.errors import FrameError
from brrp_cli.frames.dilate import widened
from brrp_cli.frames.frame import Frame
from brrp_cli.segmentation.beneath import hidden_by_itself
from brrp_cli.segmentation.left_out import stands
from brrp_cli.segmentation.rising import rising_in
from brrp_cli.segmentation.seen_surfaces import SeenSurfaces, see_surfaces

Mask = NDArray[np.bool_]


def reaching_in(
    frame: Frame, seen: SeenSurfaces, lift: NDArray[np.float64], config: SegmentConfig
) -> Mask:
    """(H, W) pixels of what reaches in; none where walls are seen, which hang together with much
    that does not. lift : (H, W) metres above which something has risen"""
    if seen.table.walled:
        return np.zeros(frame.shape, dtype=bool)
    ndimage = import_library("scipy.ndimage")
    own = config.reaching_in
    with np.errstate(invalid="ignore"):
        rises = seen.height > lift
    labels, _ = ndimage.label(rises & ~seen.jumps)
    found = np.zeros(labels.shape, dtype=bool)
    margin = _margin(labels.shape, own.foot)
    for label in _at_the_border(labels, own):
        mine = labels == label
        # What is behind the table stands elsewhere.
        if (seen.beside[mine] <= 0).mean() < own.over or not _hangs(seen.height, mine, margin, own):
            continue
        # Of upright things, from above, the foot is hidden.
        if hidden_by_itself(mine, frame, seen.table.plane, config.left_out) < own.hides:
            found |= mine
    if found.any():
        found = _with_parts(found, labels, frame, seen, config)
        # With the pixels beside which depth jumps, as far as they belong to nothing else.
        grown = ndimage.binary_dilation(found, iterations=own.rim)
        others = ndimage.binary_dilation((labels > 0) & ~found, iterations=1)
        found |= grown & rises & ~others
    return found


def _with_parts(
    found: Mask,
    labels: NDArray[np.integer],
    frame: Frame,
    seen: SeenSurfaces,
    config: SegmentConfig,
) -> Mask:
    """The same pixels (H, W) with those of components (H, W) that hang beside them, such as a hand
    or its fingers, from which missing depth parts an arm."""
    own = config.reaching_in
    ndimage, spatial = (import_library(f"scipy.{name}") for name in ("ndimage", "spatial"))
    sizes = np.bincount(labels.ravel())
    windows = {
        i: window
        for i, window in enumerate(ndimage.find_objects(labels), start=1)
        if sizes[i] >= own.part and not found[window][labels[window] == i].any()
    }
    found = found.copy()
    while True:
        tree = spatial.cKDTree(seen.points[found][:: own.every])
        added = [
            i
            for i, window in windows.items()
            if _is_part(labels, i, window, tree, frame, seen, config)
        ]
        if not added:
            return found
        found |= np.isin(labels, added)
        for i in added:
            del windows[i]


def _is_part(
    labels: NDArray[np.integer],
    label: int,
    window: tuple[slice, slice],
    tree: Any,
    frame: Frame,
    seen: SeenSurfaces,
    config: SegmentConfig,
) -> bool:
    """Whether a component is near the points of a `tree`, and hangs there."""
    own = config.reaching_in
    mine = labels[window] == label
    if float(np.percentile(seen.height[window][mine], own.lowest)) < own.clear:
        return False
    distance, _ = tree.query(seen.points[window][mine], distance_upper_bound=own.near)
    if not np.isfinite(distance).any():
        return False
    wider = widened(window, config.left_out.reach)
    around = (labels[wider], seen.depth[wider], seen.height[wider])
    mine = labels[wider] == label
    nowhere = np.zeros(mine.shape, dtype=bool)
    if stands(mine, *around, nowhere, own.clear, config.left_out):
        return False
    return hidden_by_itself(labels == label, frame, seen.table.plane, config.left_out) < own.hides


def arms_in(frame: Frame, seed: int, config: SegmentConfig) -> Mask:
    """(H, W) pixels of what reaches into a frame; none where no table is found."""
    try:
        seen = see_surfaces(frame, seed, config)
    except FrameError:
        return np.zeros(frame.shape, dtype=bool)
    return reaching_in(frame, seen, rising_in(frame, seen, config).lift, config)


def _at_the_border(labels: NDArray[np.integer], config: ReachingInConfig) -> list[int]:
    """The large components (H, W) of which much lies on the image's border."""
    sizes = np.bincount(labels.ravel())
    on_border = np.bincount(labels[_margin(labels.shape, config.border)], minlength=len(sizes))
    large = (sizes >= config.pixels) & (on_border >= config.cut)
    return [int(label) for label in np.flatnonzero(large) if label > 0]


def _hangs(height: NDArray[np.float64], mine: Mask, margin: Mask, config: ReachingInConfig) -> bool:
    """Whether the lower end of what is `mine` (H, W) is above the table, and in sight. Of what goes
    on beneath the image's `margin` (H, W), nobody knows."""
    low = float(np.percentile(height[mine], config.lowest))
    if low < config.clear:
        return False
    foot = mine & (height <= low)
    return bool(margin[foot].mean() < config.hidden)


def _margin(shape: tuple[int, ...], width: int) -> Mask:
    margin = np.ones(shape, dtype=bool)
    margin[width:-width, width:-width] = False
    return margin
