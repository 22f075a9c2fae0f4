"""The loop that scores how observed points lie on a model, against its formula."""

from __future__ import annotations

import numpy as np
import pytest

from brrp_cli.distance_loops import explained

UNIT, SPACING = 0.1, 0.05


def test_points_count_by_a_bell_of_their_distance_and_against_what_is_far() -> None:
    # Distances to the plane x = 0 of the model are exact between the nodes of a grid.
    x = np.arange(41) * SPACING - 1
    values = np.broadcast_to(x[:, None, None], (41, 41, 41)).astype(np.float32)
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (500, 3))
    moved = np.tile(np.eye(4), (3, 1, 1))
    moved[1, 0, 3], moved[2, :3, :3] = 0.01, 2 * np.eye(3)  # beside it, and of half its size
    near, far, distance = 0.004, 0.03, 0.5
    off = np.abs(np.stack([points[:, 0], points[:, 0] + 0.01, points[:, 0]]))
    like = np.exp(-0.5 * (off / near) ** 2)
    expected = (like - distance * np.minimum(off, far) / far).mean(axis=1)
    found = explained(values, np.full(3, -1.0), SPACING, UNIT, moved, points, near, far, distance)
    assert found == pytest.approx(expected, abs=1e-6)
