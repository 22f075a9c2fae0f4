"""The unknowns of a stretched shape: turn, middle (3), logarithms of half (3), taper. What they are
expected to be, and how far one step may move them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig

Array = NDArray[np.float64]
Reals = NDArray[np.floating]

UNKNOWNS = 8
# What no point sees, such as the turn of what is round, stays: far below any point's weight.
LEAST_WEIGHT = 1e-3


def size_prior(
    half: Reals, stored_half: Reals, height: Reals, taper: Reals, config: KinConfig
) -> tuple[Array, Array, Array]:
    """Cost (B,), Hessian (B, 8, 8) and gradient (B, 8) of sizes, stretches, taper and the
    underside.

    half, stored_half : (B, 3) metres, of the box, and as it is stored; height : (B,) metres,
    of its middle over the plane; taper : (B,)
    """
    count = len(half)
    log = np.log(half / stored_half).astype(np.float64)
    H, g = np.zeros((count, UNKNOWNS, UNKNOWNS)), np.zeros((count, UNKNOWNS))
    mean, spread = np.full((3, 3), 1 / 3), np.eye(3) - 1 / 3
    metric = (
        mean / 3 / config.size_deviation**2 + spread / config.stretch_deviation**2
    ) * config.pull
    H[:, 4:7, 4:7] += metric
    g[:, 4:7] += log @ metric
    stiff = config.pull / config.taper_deviation**2
    H[:, 7, 7] += stiff
    g[:, 7] += stiff * taper
    # Underside: middle_z - half_z.
    row = np.zeros((count, UNKNOWNS))
    row[:, 3], row[:, 6] = 1, -half[:, 2]
    lift = (height - half[:, 2]).astype(np.float64)
    H += config.pull * row[:, :, None] * row[:, None] / config.lift_deviation**2
    g += config.pull * row * lift[:, None] / config.lift_deviation**2
    cost = np.einsum("bi,ij,bj->b", log, metric, log) + stiff * taper.astype(np.float64) ** 2
    cost += config.pull * (lift / config.lift_deviation) ** 2
    return cost / 2, H, g


def limited(step: Array, config: KinConfig) -> Array:
    """A step (..., 8), no part of which is longer than it may be."""
    largest = np.array(
        [
            config.step_turn,
            *[config.step_shift] * 3,
            *[config.step_size] * 3,
            config.step_taper,
        ]
    )
    return np.clip(step, -largest, largest)
