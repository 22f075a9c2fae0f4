"""A robot's arm that reaches in over the objects, as most cameras at a robot see it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tabletop.camera import Camera
from tabletop.settle import TABLE, Panel

# Degrees from the camera's side of the objects to that of the arm: never between the two.
SIDE = (50.0, 310.0)
# Metres: of the fingertips over what is beneath the hand, and beside the objects' middle.
CLEARANCE, BESIDE = (0.02, 0.15), 0.1
TILT = (0.0, 40.0)  # of the hand from straight down, degrees
FINGER = np.array([0.01, 0.01, 0.025])  # half a finger's size, metres
PALM = np.array([0.1, 0.03, 0.035])
OPENING = (0.0, 0.08)
# Metres: radii of the links, and lengths of wrist, forearm and upper arm.
RADII, WRIST, FOREARM, UPPER_ARM = (0.035, 0.065), (0.08, 0.15), (0.3, 0.45), (0.3, 0.45)
RISE = (-5.0, 50.0)  # of the forearm towards the elbow, degrees
SIDES = 3  # boxes about an axis that make a link nearly round
# White, grey, black, orange, blue: what arms are painted.
COLORS = ((0.9, 0.9, 0.88), (0.5, 0.5, 0.52), (0.12, 0.12, 0.13), (0.9, 0.4, 0.05), (0.1, 0.3, 0.6))


@dataclass(frozen=True)
class Robot:
    """boxes : palm, fingers and links, metres, world; color : (3,), 0 to 1"""

    boxes: tuple[Panel, ...]
    color: tuple[float, float, float]

    @property
    def ground(self) -> Panel:
        """The table."""
        return TABLE

    def panels(self) -> list[Panel]:
        """All of the arm."""
        return list(self.boxes)


def draw_robot(points: NDArray[np.float64], camera: Camera, rng: np.random.Generator) -> Robot:
    """An arm whose hand is over points (n, 3), metres, world, and that comes from a side on which
    the camera is not."""
    # Cameras of OpenGL look along -z.
    to_camera = np.arctan2(camera.view[2, 1], camera.view[2, 0])
    turn = to_camera + np.deg2rad(rng.uniform(*SIDE))
    outward, up = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([0.0, 0.0, 1.0])
    plan = points[:, :2].mean(axis=0) + rng.uniform(-BESIDE, BESIDE, 2)
    beneath = points[np.linalg.norm(points[:, :2] - plan, axis=1) < 1.2 * PALM[0], 2]
    clearance, tilt = rng.uniform(*CLEARANCE), np.deg2rad(rng.uniform(*TILT))
    backward = np.cos(tilt) * up + np.sin(tilt) * outward
    hand = _along(backward, rng.uniform(0, 2 * np.pi))
    opening = rng.uniform(*OPENING)
    # Tilted, one corner of the fingers is lower than where they meet.
    both = FINGER + [opening / 2 + FINGER[0], 0, 0]
    lower = np.abs(hand.as_matrix()[2]) @ both - FINGER[2] * backward[2]
    tips = np.array([*plan, beneath.max(initial=0.0) + clearance + lower])
    boxes = [Panel(tips + (2 * FINGER[2] + PALM[2]) * backward, hand.as_quat(), PALM)]
    for side in (-1, 1):
        across = side * (opening / 2 + FINGER[0]) * hand.apply([1.0, 0.0, 0.0])
        boxes.append(Panel(tips + FINGER[2] * backward + across, hand.as_quat(), FINGER))
    radius = rng.uniform(*RADII)
    flange = tips + 2 * (FINGER[2] + PALM[2]) * backward
    wrist = flange + rng.uniform(*WRIST) * backward
    rise, fall = np.deg2rad(rng.uniform(*RISE)), np.deg2rad(rng.uniform(*RISE))
    elbow = wrist + rng.uniform(*FOREARM) * (np.cos(rise) * outward + np.sin(rise) * up)
    shoulder = elbow + rng.uniform(*UPPER_ARM) * (np.cos(fall) * outward - np.sin(fall) * up)
    base = np.array([*shoulder[:2], 0.0])
    joints = [flange, wrist, elbow, shoulder, base]
    for start, end in pairwise(joints):
        boxes += _link(start, end, radius)
    return Robot(tuple(boxes), COLORS[rng.integers(len(COLORS))])


def _along(axis: NDArray[np.float64], turn: float) -> Rotation:
    """A rotation that takes z to `axis`, after a turn about it."""
    rotation, _ = Rotation.align_vectors(axis[None], np.array([[0.0, 0.0, 1.0]]))
    return rotation * Rotation.from_euler("z", turn)


def _link(start: NDArray[np.float64], end: NDArray[np.float64], radius: float) -> list[Panel]:
    """A link from joint to joint, and half its width beyond both: boxes about its axis."""
    along = end - start
    length = float(np.linalg.norm(along))
    half = np.array([radius, np.tan(np.pi / (4 * SIDES)) * radius, length / 2 + radius / 2])
    # Each box gives two sides of a polygon of 4 SIDES corners, as wide as it is long.
    turns = np.arange(2 * SIDES) * np.pi / (2 * SIDES)
    return [
        Panel((start + end) / 2, _along(along / length, turn).as_quat(), half) for turn in turns
    ]
