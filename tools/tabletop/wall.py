"""A wall behind the objects, as a camera before it sees one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tabletop.camera import Camera
from tabletop.furniture import any_color
from tabletop.settle import TABLE, Panel

# Half its size, metres: it fills the upper part of every image that has one.
HALF = np.array([0.01, 2.0, 0.75])
# Metres behind the last object, and degrees from square to the line of sight.
GAP, TURN = (0.02, 0.2), (-20.0, 20.0)


@dataclass(frozen=True)
class Wall:
    """position : (2,) metres, world, of the middle of its foot; turn : of its normal, which points
    away from the objects, about the table's, radians; color : (3,), 0 to 1"""

    position: NDArray[np.float64]
    turn: float
    color: tuple[float, float, float]

    @property
    def ground(self) -> Panel:
        """The table."""
        return TABLE

    def panels(self) -> list[Panel]:
        """The wall, which stands on the table's plane."""
        from scipy.spatial.transform import Rotation

        middle = np.array([*self.position, HALF[2]])
        return [Panel(middle, Rotation.from_euler("z", self.turn).as_quat(), HALF)]


def draw_wall(points: NDArray[np.float64], camera: Camera, rng: np.random.Generator) -> Wall:
    """A wall of any colour behind points (n, 3), metres, world, as the camera sees them."""
    # Cameras of OpenGL look along -z.
    away = -camera.view[2, :2]
    turn = float(np.arctan2(away[1], away[0]) + np.deg2rad(rng.uniform(*TURN)))
    normal = np.array([np.cos(turn), np.sin(turn)])
    plan = points[:, :2]
    last = float((plan @ normal).max()) + rng.uniform(*GAP)
    across = plan.mean(axis=0) - (plan.mean(axis=0) @ normal) * normal
    color = any_color(rng)
    return Wall(
        position=across + (last + HALF[0]) * normal,
        turn=turn,
        color=color,
    )
