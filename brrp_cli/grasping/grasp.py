"""What a planner of grasps gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.grasping.gripper import Gripper

Array = NDArray[np.float64]
Reals = TypeVar("Reals", float, Array)


@dataclass(frozen=True)
class Grasp:
    """One hand, ready to close.

    T_cam_gripper : (4, 4), the gripper's frame (brrp_cli/grasping/gripper.py) in the camera's
    opening : metres between the fingers on the way in; width : between them when they hold
    score : probability that it holds; quality : in [0, 1], ranks grasps with nearly the same score
    contacts : (2, 3) metres, camera frame, the left finger's (at -x) first
    """

    object_id: int
    T_cam_gripper: Array
    opening: float
    width: float
    score: float
    quality: float
    contacts: Array


@dataclass(frozen=True)
class ObjectGrasps:
    """Grasps of one object, best first, and how many candidates fell, and why. `why` says for
    people why there is none."""

    object_id: int
    grasps: list[Grasp]
    fell: dict[str, int] = field(default_factory=dict)
    why: str = ""


@dataclass(frozen=True)
class GraspPlan:
    """Of a scene: one entry for each object, with a mesh or without; what decided it."""

    objects: list[ObjectGrasps]
    gripper: Gripper
    config: GraspConfig
    approach: str
    min_score: float
    per_object: int
    seed: int

    @property
    def grasps(self) -> list[Grasp]:
        """All, best first."""
        every = [grasp for each in self.objects for grasp in each.grasps]
        return sorted(every, key=lambda each: -worth(each.score, each.quality, self.config))


def worth(score: Reals, quality: Reals, config: GraspConfig) -> Reals:
    """What grasps are ranked by: the score, which a few draws tell roughly, and a little of the
    quality, which knows of levers."""
    return score * quality**config.taste
