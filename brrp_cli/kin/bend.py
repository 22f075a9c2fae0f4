"""Smooth bends of a shape in its box: what scales alone cannot make of one bowl the other.

A point u of the box goes to u + w(u), with w a cubic polynomial whose coefficients have a Gaussian
prior. Most of its variance goes to bends that keep a shape as symmetric as it is, so that what was
seen of one side tells of the side that was not; some to leaning; little to all others.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import KinConfig

Array = NDArray[np.float64]

# Powers of u_x, u_y and u_z in each term of w. Shifts are no bends.
POWERS = np.array([p for p in product(range(4), repeat=3) if 1 <= sum(p) <= 3])
TERMS = len(POWERS)
_AXES = np.eye(3, dtype=int)
# Scales along the axes are no bends either: the prior holds them at nothing.
_NONE = 1e-3
# Where a bend must not fold space.
_LATTICE = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 3), axis=-1).reshape(-1, 3)


def terms(u: Array) -> Array:
    """(n, K) at points u (n, 3)."""
    x, y, z = _powers(u)
    return np.stack([x[i] * y[j] * z[k] for i, j, k in POWERS], axis=1)


def slopes(u: Array) -> Array:
    """(n, K, 3): of the terms along u, at points u (n, 3)."""
    powers = _powers(u)
    found = np.zeros((len(u), TERMS, 3))
    for row, exponents in enumerate(POWERS):
        for axis in np.flatnonzero(exponents):
            x, y, z = (powers[i, power] for i, power in enumerate(exponents - _AXES[axis]))
            found[:, row, axis] = exponents[axis] * x * y * z
    return found


def _powers(u: Array) -> Array:
    """(3, 4, n): 1, u, u^2 and u^3 along each axis."""
    return np.stack([np.ones_like(u.T), u.T, u.T**2, u.T**3], axis=1)


@cache
def _lattice_slopes() -> Array:
    return slopes(_LATTICE)


def unfolded(bend: Array, steepest: float) -> Array:
    """A bend (3, K), made smaller where its slopes in the box exceed `steepest`, under 1."""
    steep = np.linalg.norm(np.einsum("ak,nki->nai", bend, _lattice_slopes()), axis=(1, 2)).max()
    return np.asarray(bend * min(1.0, steepest / max(float(steep), 1e-9)))


def prior_precision(half: NDArray[np.floating], config: KinConfig) -> Array:
    """(3K, 3K) of the coefficients (3, K) in a box with half the sides `half` (3,), metres."""
    deviation = np.full((3, TERMS), config.bend_any)
    for axis, scale in enumerate(_AXES):
        deviation[axis, row(scale)] = _NONE
    covariance = np.diag(deviation.ravel() ** 2)
    for modes, spread in (
        (ROUND, config.bend_round),
        (EVEN, config.bend_even),
        (leaning(half), config.bend_lean),
    ):
        for mode in modes:
            flat = np.zeros((3, TERMS))
            for axis, powers, size in mode:
                flat[axis, row(powers)] = size
            covariance += spread**2 * np.outer(flat, flat)
    return np.linalg.inv(covariance)


Mode = tuple[tuple[int, tuple[int, ...], float], ...]

# What these bend stays round about z.
ROUND: tuple[Mode, ...] = (
    ((0, (1, 0, 2), 1), (1, (0, 1, 2), 1)),
    ((0, (3, 0, 0), 1), (0, (1, 2, 0), 1), (1, (2, 1, 0), 1), (1, (0, 3, 0), 1)),
    ((2, (0, 0, 2), 1),),
    ((2, (0, 0, 3), 1),),
    ((2, (2, 0, 0), 1), (2, (0, 2, 0), 1)),
    ((2, (2, 0, 1), 1), (2, (0, 2, 1), 1)),
)


def _even() -> tuple[Mode, ...]:
    """What these bend keeps two sides alike that were alike, left and right, and front and back."""
    modes: list[Mode] = []
    for axis, powers in product(range(3), POWERS):
        across = powers[:2] - _AXES[axis, :2]
        if not (across % 2).any() and (powers != _AXES[axis]).any():
            modes.append(((axis, tuple(int(each) for each in powers), 1.0),))
    return tuple(modes)


EVEN = _even()


def leaning(half: NDArray[np.floating]) -> tuple[Mode, ...]:
    """Small rotations about y and about x, by one radian."""
    x, y, z = (float(side) for side in half)
    return (
        ((0, (0, 0, 1), z / x), (2, (1, 0, 0), -x / z)),
        ((1, (0, 0, 1), z / y), (2, (0, 1, 0), -y / z)),
    )


def row(powers: tuple[int, ...] | NDArray[np.int64]) -> int:
    """Which term has these powers."""
    return int(np.flatnonzero((np.asarray(powers) == POWERS).all(axis=1))[0])
