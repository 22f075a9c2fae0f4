"""Walls behind a table: of two planes that meet in a corner, things stand on one of them alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.observation import ObservationConfig, WallConfig
from brrp_cli.geometry import lengths
from brrp_cli.observation.support_plane import Plane, fit_plane, plane_frame
from brrp_cli.seeds import child_seed

Array = NDArray[np.floating]


def supporting_plane(
    points: Array, things: Array, config: ObservationConfig, seed: int, toward: Array
) -> Plane | None:
    """The largest plane of the background, as `fit_plane` finds it, unless that is a wall; then the
    one beneath it.

    points : (n, 3) of the background; things : (m, 3) of the objects; toward : (3,) the scene's
    centre; metres, camera frame. None where no plane is found.
    """
    largest = fit_plane(points, config, seed, toward)
    if largest is None or config.wall is None:
        return largest
    near = points[lengths(points - toward) < config.plane_radius]
    rest = near[np.abs(largest.signed_distance(near)) >= config.plane_tolerance]
    if len(rest) < config.wall.of_wall * (len(near) - len(rest)):
        return largest
    other = fit_plane(rest, config, child_seed(seed, "beneath a wall"), toward)
    if other is None or not is_wall(largest, other, near, things, config.wall):
        return largest
    return other


def is_wall(
    plane: Plane, table: Plane, background: Array, things: Array, config: WallConfig
) -> bool:
    """Whether a plane is a wall that rises behind a table.

    The two are square to each other, what is seen of each lies in front of the other, and things
    touch the table more than the wall. So a box on a table is no wall: the table goes on behind
    its sides.

    background : (n, 3) metres, camera frame, of both planes and of other things; things : (m, 3) of
    what stands on one of them
    """
    if abs(plane.normal @ table.normal) > np.sin(np.radians(config.square)):
        return False
    above_wall, above_table = (each.signed_distance(background) for each in (plane, table))
    wall = (np.abs(above_wall) < config.near) & (np.abs(above_table) >= config.near)
    flat = (np.abs(above_table) < config.near) & (np.abs(above_wall) >= config.near)
    if not wall.any() or flat.sum() < config.of_wall * wall.sum():
        return False
    in_front = (above_table[wall] > 0).mean(), (above_wall[flat] > 0).mean()
    if min(in_front) < config.in_front:
        return False
    # The corner itself is near to both.
    clear = (plane.signed_distance(things) > config.clear) & (
        table.signed_distance(things) > config.clear
    )
    touched, touches = (touching(each, things[clear], config) for each in (plane, table))
    return touches > touched + config.more


def touching(plane: Plane, things: Array, config: WallConfig) -> float:
    """The share of the cells of a plane that things (n, 3), metres, camera frame, lie over, which
    come within `config.low` of it there; 0 without things."""
    if not len(things):
        return 0.0
    cells = np.floor(things @ plane_frame(plane)[:2, :3].T / config.cell).astype(np.int64)
    _, number = np.unique(cells, axis=0, return_inverse=True)
    lowest = np.full(number.max() + 1, np.inf)
    np.minimum.at(lowest, number.ravel(), plane.signed_distance(things))
    return float((lowest < config.low).mean())


def behind_wall(points: Array, wall: Plane, near: float) -> NDArray[np.bool_]:
    """(...,) which of points (..., 3), metres, camera frame, are a wall or lie behind it: nearer to
    it than `near` metres, which beyond a depth of one grow with its square."""
    far = np.maximum(points[..., 2], 1.0) ** 2
    return np.asarray(wall.signed_distance(points) < near * far)
