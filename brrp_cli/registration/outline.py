"""What the beginnings of a search ask of the seen points alone: found once for all models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import SearchConfig
from brrp_cli.geometry import normalise, transform_points
from brrp_cli.observation.support_plane import Plane, plane_frame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Footprint:
    """How what is seen lies along its plane, without strays.

    plane; T_plane_cam : (4, 4); middle : (2,) of its box; top : its height, metres;
    extents : (n,) how far it reaches in directions evenly spread over half a turn, from x on
    """

    plane: Plane
    T_plane_cam: Array
    middle: Array
    top: float
    extents: Array

    def extent(self, directions: Array) -> Array:
        """How far it reaches in directions (B, 2), metres (B,)."""
        angle = np.arctan2(directions[:, 1], directions[:, 0])
        at = _half_turn(len(self.extents))
        return np.interp(angle, at, self.extents, period=np.pi)


@dataclass(frozen=True)
class Outline:
    """How what is seen lies before the camera, without strays.

    footprint : None without a plane; centre : (3,) the mean of its points; axes : (3, 3) its
    principal axes, the columns; T_sight_cam : (3, 3), to two directions across the line of sight,
    and it; low, high : (3,) along those
    """

    footprint: Footprint | None
    centre: Array
    axes: Array
    T_sight_cam: Array
    low: Array
    high: Array


def outline(points: Array, plane: Plane | None, config: SearchConfig) -> Outline:
    """Of seen points (n, 3), metres, camera frame, in random order."""
    seen = points[: config.box_points]
    ahead = normalise(points.mean(axis=0))
    T_sight_cam = np.stack([*np.linalg.svd(ahead[None])[2][1:], ahead])
    low, high = _box(seen @ T_sight_cam.T, config)
    centre = seen.mean(axis=0)
    return Outline(
        footprint=None if plane is None else _footprint(points, plane, config),
        centre=centre,
        axes=principal_axes(seen - centre),
        T_sight_cam=T_sight_cam,
        low=low,
        high=high,
    )


def principal_axes(points: Array) -> Array:
    """Principal axes (3, 3), the columns, right-handed, of points (n, 3) about their middle."""
    axes = np.linalg.eigh(points.T @ points)[1]
    axes[:, 2] *= np.linalg.det(axes)
    return np.asarray(axes)


def _footprint(points: Array, plane: Plane, config: SearchConfig) -> Footprint:
    T_plane_cam = plane_frame(plane)
    moved = transform_points(T_plane_cam, points[: config.box_points])
    seen = np.asarray(moved, dtype=np.float64)[:, :2]
    angle = _half_turn(config.directions)
    low, high = _box(seen @ np.stack([np.cos(angle), np.sin(angle)]), config)
    return Footprint(
        plane=plane,
        T_plane_cam=T_plane_cam,
        middle=_box(seen, config).mean(axis=0),
        top=float(np.quantile(plane.signed_distance(points), 1 - config.stray)),
        extents=high - low,
    )


def _half_turn(count: int) -> Array:
    """(count,) radians, evenly spread."""
    return np.asarray(np.arange(count) * (np.pi / count))


def _box(points: Array, config: SearchConfig) -> Array:
    """Least and most (2, d) of points (n, d), without strays."""
    return np.asarray(np.quantile(points, [config.stray, 1 - config.stray], axis=0))
