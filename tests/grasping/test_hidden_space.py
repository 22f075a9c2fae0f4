"""Space that what stands around hides from the camera."""

from __future__ import annotations

import numpy as np
import trimesh

from brrp_cli.config.grasping import GraspConfig, SurroundingsConfig
from brrp_cli.grasping.gripper_file import DEFAULT, open_gripper
from brrp_cli.grasping.hidden_space import hidden_behind
from brrp_cli.grasping.obstacles import Obstacles

CONFIG = SurroundingsConfig()
# A plate of 20 x 10 cm, square to the optical axis, a metre away.
SIDES = np.arange(-0.1, 0.1, CONFIG.cell), np.arange(-0.05, 0.05, CONFIG.cell)
PLATE = np.stack([*(each.ravel() for each in np.meshgrid(*SIDES)), np.ones(25 * 13)], axis=-1)


def test_what_lies_behind_a_plate_is_hidden():
    hidden = hidden_behind(PLATE, CONFIG)
    behind = np.array([[0.0, 0.0, 1.1], [0.1, 0.05, 1.3], [0.0, 0.0, 5.0]])
    assert hidden.holds(behind).all()
    seen = np.array([[0, 0, 0.9], [0, 0, 1.01], [0.2, 0, 1.1], [0, 0.15, 1.3], [0, 0, -1.1]])
    assert not hidden.holds(seen).any()


def test_nothing_hides_nothing():
    hidden = hidden_behind(PLATE[:0], CONFIG)
    assert not hidden.holds(np.array([[0.0, 0.0, 1.0]])).any()


def test_a_hand_does_not_go_where_nothing_is_seen():
    """Behind the plate, and through it, and not in front of it."""
    gripper, opening = open_gripper(DEFAULT), np.array([0.06])
    around = Obstacles([], np.zeros((0, 3)), hidden_behind(PLATE, CONFIG))
    # Hands that come down along y, with the fingers' ends at its height in the image.
    down = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])

    def hits(depth: float) -> bool:
        T = down.copy()
        T[:3, 3] = 0.0, -0.1, depth
        return bool(around.probably_hits(T[None], opening, gripper, GraspConfig())[0])

    assert hits(1.3) and not hits(0.8)
    none = around.probably_hits(np.zeros((0, 4, 4)), np.zeros(0), gripper, GraspConfig())
    assert none.shape == (0,)
    free = Obstacles([], np.zeros((0, 3)), hidden_behind(PLATE[:0], CONFIG))
    T = down.copy()
    T[:3, 3] = 0.0, -0.1, 1.3
    assert not free.probably_hits(T[None], opening, gripper, GraspConfig()).any()
