"""A bin on the table, in which objects lie: a floor and four walls that lean outwards a little."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tabletop.furniture import any_color
from tabletop.settle import TABLE, Panel

# Ranges in metres, and of the walls' lean in degrees: from a shoe box to a tote.
LENGTH, WIDTH, HEIGHT = (0.3, 0.6), (0.22, 0.4), (0.06, 0.22)
THICKNESS, LEAN = (0.003, 0.006), (0.0, 6.0)


@dataclass(frozen=True)
class Bin:
    """length, width (inside, at the floor), height, thickness : metres; lean : of the walls,
    radians outwards; turn : about the table's normal, radians; color : (3,), 0 to 1"""

    length: float
    width: float
    height: float
    thickness: float
    lean: float
    turn: float
    color: tuple[float, float, float]

    @property
    def radius(self) -> float:
        """Of the disc about the middle that objects are dropped within, metres."""
        return 0.35 * self.width

    @property
    def ground(self) -> Panel:
        """The table."""
        return TABLE

    def around(self) -> list[Panel]:
        """What stands around objects that are dropped: all of it."""
        return self.panels()

    def panels(self) -> list[Panel]:
        """The floor and the walls, with the floor's underside on the table."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_euler("z", self.turn)
        half = self.thickness / 2
        floor = np.array([self.length / 2 + half, self.width / 2 + half, half])
        panels = [Panel(np.array([0.0, 0.0, half]), turned.as_quat(), floor)]
        # Walls that lean outwards are longer above than below: what is too long sticks out.
        spread = 2 * self.height * np.sin(self.lean) + 2 * self.thickness
        for number in range(4):
            sides = (self.length, self.width)
            across, along = sides if number % 2 == 0 else sides[::-1]
            side = Rotation.from_euler("z", number * np.pi / 2)
            lean = Rotation.from_euler("y", self.lean)
            foot = np.array([across / 2 + half, 0.0, 0.0])
            middle = foot + lean.apply([0.0, 0.0, self.height / 2])
            size = np.array([half, (along + spread) / 2, self.height / 2])
            pose = turned * side
            panels.append(Panel(pose.apply(middle), (pose * lean).as_quat(), size))
        return panels


def draw_bin(rng: np.random.Generator) -> Bin:
    """A bin of any size, colour and direction."""
    color = any_color(rng)
    return Bin(
        length=float(rng.uniform(*LENGTH)),
        width=float(rng.uniform(*WIDTH)),
        height=float(rng.uniform(*HEIGHT)),
        thickness=float(rng.uniform(*THICKNESS)),
        lean=float(np.deg2rad(rng.uniform(*LEAN))),
        turn=float(rng.uniform(0, 2 * np.pi)),
        color=color,
    )
