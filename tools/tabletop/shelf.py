"""A compartment of a shelf, in which objects stand: a board beneath them, one above, two sides and
a back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tabletop.furniture import any_color
from tabletop.settle import TABLE, Panel

# Ranges in metres, inside; of the lower board above the floor, too.
WIDTH, DEPTH, ABOVE_FLOOR = (0.4, 0.9), (0.25, 0.45), (0.3, 1.2)
THICKNESS = (0.012, 0.03)
# Of the upper board above the objects, and above the lower one at least.
CLEAR, LOWEST = (0.02, 0.2), 0.2
# What is dropped from above passes the upper board's place, and stays within the sides.
WHILE_DROPPED = 1.0
# Degrees by which a camera stands beside the middle of its opening.
BESIDE = 30.0


@dataclass(frozen=True)
class Shelf:
    """width, depth, height (inside), thickness : metres; height is 0 until objects tell it;
    clear : of the upper board above them; above_floor : of the lower one; turn : of the opening
    about the table's normal, radians; color : (3,), 0 to 1"""

    width: float
    depth: float
    height: float
    thickness: float
    clear: float
    above_floor: float
    turn: float
    color: tuple[float, float, float]

    @property
    def radius(self) -> float:
        """Of the disc about the middle that objects are dropped within, metres."""
        return 0.4 * self.depth

    @property
    def azimuth(self) -> tuple[float, float]:
        """Radians about the table's normal, between which a camera sees into it."""
        return self.turn - np.deg2rad(BESIDE), self.turn + np.deg2rad(BESIDE)

    @property
    def ground(self) -> Panel:
        """The floor that the shelf stands on."""
        return replace(TABLE, position=TABLE.position - [0, 0, self.above_floor])

    def around(self) -> list[Panel]:
        """All but the upper board, higher than anything is dropped from."""
        return replace(self, height=WHILE_DROPPED).panels()[:-1]

    def over(self, points: NDArray[np.float64]) -> Shelf:
        """The shelf whose upper board lies above points (n, 3), metres, world."""
        return replace(self, height=max(LOWEST, float(points[:, 2].max()) + self.clear))

    def panels(self) -> list[Panel]:
        """The lower board, a back, two sides and the upper board, which end at one front."""
        from scipy.spatial.transform import Rotation

        t, half = self.thickness, self.thickness / 2
        width, depth, height = self.width / 2 + t, self.depth / 2, self.height / 2
        # The opening looks along x; the back closes what the others leave.
        boxes = [
            ((0.0, 0.0, -half), (depth, width, half)),
            ((-depth - half, 0.0, height), (half, width, height + t)),
            ((0.0, width - half, height), (depth, half, height)),
            ((0.0, half - width, height), (depth, half, height)),
            ((0.0, 0.0, self.height + half), (depth, width, half)),
        ]
        turned = Rotation.from_euler("z", self.turn)
        return [
            Panel(turned.apply(middle), turned.as_quat(), np.array(size)) for middle, size in boxes
        ]


def draw_shelf(rng: np.random.Generator) -> Shelf:
    """A compartment of any width, depth, colour and direction."""
    color = any_color(rng)
    return Shelf(
        width=float(rng.uniform(*WIDTH)),
        depth=float(rng.uniform(*DEPTH)),
        height=0.0,
        thickness=float(rng.uniform(*THICKNESS)),
        clear=float(rng.uniform(*CLEAR)),
        above_floor=float(rng.uniform(*ABOVE_FLOOR)),
        turn=float(rng.uniform(0, 2 * np.pi)),
        color=color,
    )
