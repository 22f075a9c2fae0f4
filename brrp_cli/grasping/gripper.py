"""A parallel-jaw hand as three boxes, and the frame in which they stand.

The gripper's frame: origin where the hand is mounted; z, the approach, towards the fingertips; x,
the direction in which the fingers close; y = z x x. The palm reaches from z = 0 to its length, the
fingers from there to `tip`. The inner faces of the fingers are at x = -+opening / 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrp_cli.geometry import grid_nodes

if TYPE_CHECKING:
    from brrp_cli.observation.support_plane import Plane

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gripper:
    """Metres.

    opening : between the fingers' inner faces, widest
    finger_length : beyond the palm; finger_width : along y; finger_thickness : along x
    palm_width : along x; palm_depth : along y; palm_length : along z
    force : newtons, with which the fingers close
    source : where the numbers are from
    """

    name: str
    opening: float
    finger_length: float
    finger_width: float
    finger_thickness: float
    palm_width: float
    palm_depth: float
    palm_length: float
    force: float
    source: str

    @property
    def tip(self) -> float:
        """z of the fingertips' ends."""
        return self.palm_length + self.finger_length

    def boxes(self, openings: NDArray[np.floating], back: float = 0.0) -> Array:
        """(n, 3, 2, 3) lower and upper corners of finger, finger and palm in the gripper's frame,
        of hands that are open by `openings` (n,).

        back : metres along -z by which each box is longer: what it sweeps on its way in
        """
        half = np.asarray(openings, dtype=np.float64) / 2
        boxes = np.empty((len(half), 3, 2, 3))
        for i, sign in enumerate((-1, 1)):
            inner, outer = sign * half, sign * (half + self.finger_thickness)
            boxes[:, i, 0, 0], boxes[:, i, 1, 0] = (
                np.minimum(inner, outer),
                np.maximum(inner, outer),
            )
        boxes[:, :2, :, 1] = np.array([-0.5, 0.5]) * self.finger_width
        boxes[:, :2, :, 2] = np.array([self.palm_length - back, self.tip])
        boxes[:, 2, :, 0] = np.array([-0.5, 0.5]) * self.palm_width
        boxes[:, 2, :, 1] = np.array([-0.5, 0.5]) * self.palm_depth
        boxes[:, 2, :, 2] = np.array([-back, self.palm_length])
        return boxes

    def corners(self, openings: NDArray[np.floating], back: float = 0.0) -> Array:
        """(n, 24, 3) corners of `boxes`."""
        boxes = self.boxes(openings, back)
        pick = grid_nodes([np.arange(2)] * 3).reshape(8, 3)
        return np.asarray(boxes[:, :, pick, np.arange(3)].reshape(len(boxes), 24, 3))

    def lowest(self, T_cam_gripper: Array, openings: NDArray[np.floating], plane: Plane) -> Array:
        """(n,) metres, signed, from a plane to the lowest corner of hands T_cam_gripper
        (n, 4, 4)."""
        R, t = T_cam_gripper[:, :3, :3], T_cam_gripper[:, :3, 3]
        corners = self.corners(openings) @ np.swapaxes(R, 1, 2) + t[:, None]
        return np.asarray((corners @ plane.normal + plane.offset).min(axis=1))
