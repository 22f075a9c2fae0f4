"""Frames of which an object has lost its depth, as dark, shiny and clear things do."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_erosion

from brrp_cli.frames.frame import Frame


def without_depth(frame: Frame, object_id: int, kept: np.ndarray | None = None) -> Frame:
    """The frame without depth of an object but at pixels `kept` (H, W); of all by default."""
    own = frame.segmap == object_id
    lost = own if kept is None else own & ~kept
    return frame.with_points(np.where(lost[..., None], np.float32(np.nan), frame.points))


def at_the_edge(frame: Frame, object_id: int, count: int, behind: float) -> Frame:
    """The frame with depth of an object at `count` pixels of its mask's edge alone, and there too
    far by `behind` metres."""
    own = frame.segmap == object_id
    edge = np.flatnonzero((own & ~binary_erosion(own)).ravel())
    chosen = np.zeros(own.size, dtype=bool)
    chosen[np.random.default_rng(0).choice(edge, count, replace=False)] = True
    chosen = chosen.reshape(own.shape)
    points = without_depth(frame, object_id, chosen).points.copy()
    away = np.linalg.norm(points, axis=-1, keepdims=True)
    points[chosen] *= (1 + behind / away[chosen]).astype(np.float32)
    return frame.with_points(points)


def in_patches(frame: Frame, object_id: int, share: float, seed: int = 0) -> Frame:
    """The frame with depth of an object in patches that hold a share of its pixels."""
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(np.random.default_rng(seed).normal(size=frame.shape), 4)
    least = np.quantile(noise[frame.segmap == object_id], 1 - share)
    return without_depth(frame, object_id, noise >= least)
