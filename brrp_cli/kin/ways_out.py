"""How far points stand where an object's surface cannot be, and which way out is nearest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig
from brrp_cli.geometry import transform_points
from brrp_cli.kin.evidence import Evidence

Array = NDArray[np.float64]


def ways_out(points: Array, evidence: Evidence, config: KinConfig) -> tuple[Array, Array]:
    """Metres (n,) by which points (n, 3), frame of the plane, stand in space that was seen to be
    free or below the plane, and the unit direction (n, 3) out of it: away from the camera or
    upwards, both beyond `config.tolerance`, or aside to where something hides the point or where
    nothing tells, whichever is nearest."""
    T_cam_plane = evidence.T_cam_plane
    amount, way = np.zeros(len(points)), np.zeros((len(points), 3))
    under = np.flatnonzero(points[:, 2] < -config.tolerance)
    amount[under], way[under] = -points[under, 2] - config.tolerance, [0, 0, 1]
    seen: Array = np.asarray(transform_points(T_cam_plane, points), dtype=np.float64)
    free = np.flatnonzero(_gap(seen, evidence) > config.tolerance)
    if len(free):
        back, aside = _back(seen[free], evidence), _aside(seen[free], evidence, config)
        deep = back[0] - config.tolerance
        nearer = aside[0] < deep
        length = np.where(nearer, aside[0], deep)
        direction = np.where(nearer[:, None], aside[1], back[1]) @ T_cam_plane[:3, :3]
        more = length > amount[free]
        amount[free[more]], way[free[more]] = length[more], direction[more]
    return np.maximum(amount, 0), way


def seen_through(points: Array, evidence: Evidence, deeper: float) -> float:
    """Share of points (n, 3), frame of the plane, that stand more than `deeper` metres before what
    was measured behind them."""
    seen: Array = np.asarray(transform_points(evidence.T_cam_plane, points), dtype=np.float64)
    return float((_gap(seen, evidence) > deeper).mean())


def _gap(points: Array, evidence: Evidence) -> Array:
    """Metres (n,) in front of what was measured; 0 where nothing tells, or behind it."""
    return np.maximum(np.nan_to_num(evidence.free_depth(points), nan=0.0), 0)


def _back(points: Array, evidence: Evidence) -> tuple[Array, Array]:
    """Lengths and directions away from the camera, camera frame."""
    ray = points / np.linalg.norm(points, axis=1, keepdims=True)
    return _gap(points, evidence) / ray[:, 2], ray


def _aside(points: Array, evidence: Evidence, config: KinConfig) -> tuple[Array, Array]:
    """Lengths, infinite where there is no such way, and directions across the image."""
    angle = 2 * np.pi / config.aside_directions * np.arange(config.aside_directions)
    directions = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    reach = np.geomspace(*config.aside, config.aside_steps)
    steps = reach[:, None, None] * directions
    tried = points[:, None, None] + steps
    out = _gap(tried.reshape(-1, 3), evidence).reshape(tried.shape[:-1]) <= 0
    lengths = np.where(out, reach[:, None], np.inf).min(axis=1)
    best = lengths.argmin(axis=1)
    return lengths.min(axis=1), directions[best]
