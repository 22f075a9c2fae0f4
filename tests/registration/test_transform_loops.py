"""Transforms of many placements at once, against LAPACK."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from brrp_cli.geometry import similarity
from brrp_cli.registration.transform_loops import inverses


def test_inverses_of_similarities_are_those_of_matrices():
    rng = np.random.default_rng(0)
    turns = Rotation.random(50, random_state=0).as_matrix()
    sizes, shifts = rng.uniform(0.02, 30, 50), rng.normal(size=(50, 3))
    T = np.stack(
        [
            similarity(rotation=turn, scale=size, translation=shift)
            for turn, size, shift in zip(turns, sizes, shifts, strict=True)
        ]
    )
    np.testing.assert_allclose(inverses(T), np.linalg.inv(T), rtol=1e-9, atol=1e-12)


def test_no_placements_have_no_inverses():
    assert inverses(np.zeros((0, 4, 4))).shape == (0, 4, 4)
