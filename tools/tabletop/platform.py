"""A low platform on the table, on which objects lie: a cutting board, a mat, a plate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tabletop.furniture import any_color
from tabletop.settle import TABLE, Panel

# Ranges in metres.
LENGTH, WIDTH, THICKNESS = (0.3, 0.6), (0.22, 0.45), (0.003, 0.03)


@dataclass(frozen=True)
class Platform:
    """length, width, thickness : metres; turn : about the table's normal, radians; color : (3,),
    0 to 1"""

    length: float
    width: float
    thickness: float
    turn: float
    color: tuple[float, float, float]

    @property
    def radius(self) -> float:
        """Of the disc about the middle that objects are dropped within, metres."""
        return 0.4 * self.width

    @property
    def ground(self) -> Panel:
        """The table."""
        return TABLE

    def around(self) -> list[Panel]:
        """What objects are dropped on."""
        return self.panels()

    def panels(self) -> list[Panel]:
        """It alone, with its underside on the table."""
        from scipy.spatial.transform import Rotation

        half = np.array([self.length, self.width, self.thickness]) / 2
        turned = Rotation.from_euler("z", self.turn)
        return [Panel(np.array([0.0, 0.0, half[2]]), turned.as_quat(), half)]


def draw_platform(rng: np.random.Generator) -> Platform:
    """A platform of any size, colour and direction."""
    return Platform(
        length=float(rng.uniform(*LENGTH)),
        width=float(rng.uniform(*WIDTH)),
        thickness=float(rng.uniform(*THICKNESS)),
        turn=float(rng.uniform(0, 2 * np.pi)),
        color=any_color(rng),
    )
