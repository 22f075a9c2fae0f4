"""RANSAC on FPFH matches with all draws at once: where a search may begin.

What `ransac.py` does one draw after the other, and for few draws as well, at a fraction of the
cost: most draws fall by the length of one edge, and no motion is computed of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import RegistrationConfig
from brrp_cli.geometry import similarity

Array = NDArray[np.float64]

# Motions that are counted at once: their distances stay in the cache.
CHUNK = 64


def ransac_motions(
    source: Array, target: Array, config: RegistrationConfig, count: int, rng: np.random.Generator
) -> list[Array]:
    """Rigid T_target_source (4, 4) with most inliers of `config.iterations` draws, `count` times
    over, without those times when no draw holds together.

    source, target : (m, 3) matched points, metres
    """
    if len(source) < config.draw:
        return []
    draws = rng.integers(len(source), size=(count * config.iterations, config.draw))
    number = np.arange(len(draws)) // config.iterations
    held = _rigid_draws(draws, source, target, config.edge_length)
    draws, number = draws[held], number[held]
    if not len(draws):
        return []
    R, t = _motions(source[draws], target[draws])
    off = source[draws] @ R.mT + t[:, None] - target[draws]
    held = np.linalg.norm(off, axis=2).max(axis=1) < config.correspondence_distance
    R, t, number = R[held], t[held], number[held]
    inliers, error = _inliers(R, t, source, target, config.correspondence_distance)
    found = []
    for each in range(count):
        rows = np.flatnonzero(number == each)
        # A draw that holds has at least its own pairs.
        rows = rows[inliers[rows] > config.draw]
        if len(rows):
            best = rows[np.lexsort((error[rows], -inliers[rows]))[0]]
            found.append(similarity(rotation=R[best], translation=t[best]))
    return found


def _rigid_draws(
    draws: NDArray[np.int64], source: Array, target: Array, similar: float
) -> NDArray[np.int64]:
    """Which draws (k,) have edges that are as long in the target as in the source."""
    held = np.arange(len(draws))
    for i in range(draws.shape[1]):
        for j in range(i):
            a, b = draws[held, i], draws[held, j]
            here = np.square(source[a] - source[b]).sum(axis=1)
            there = np.square(target[a] - target[b]).sum(axis=1)
            alike = (here >= similar**2 * there) & (there >= similar**2 * here)
            held = held[alike & (a != b)]
    return held


def _motions(source: Array, target: Array) -> tuple[Array, Array]:
    """Least-squares rotations (k, 3, 3) and translations (k, 3) of triples (k, d, 3) (Kabsch)."""
    here, there = source.mean(axis=1), target.mean(axis=1)
    U, _, Vt = np.linalg.svd((target - there[:, None]).mT @ (source - here[:, None]))
    # No reflections.
    U[:, :, 2] *= np.sign(np.linalg.det(U) * np.linalg.det(Vt))[:, None]
    R = U @ Vt
    return R, there - (R @ here[..., None])[..., 0]


def _inliers(
    R: Array, t: Array, source: Array, target: Array, distance: float
) -> tuple[NDArray[np.int64], Array]:
    """Pairs (k,) that each motion brings within `distance`, and the sum (k,) of their squares."""
    counts, errors = np.zeros(len(R), np.int64), np.zeros(len(R))
    for start in range(0, len(R), CHUNK):
        part = slice(start, start + CHUNK)
        off = np.square(source @ R[part].mT + t[part, None] - target).sum(axis=2)
        near = off < distance**2
        counts[part], errors[part] = near.sum(axis=1), (off * near).sum(axis=1)
    return counts, errors
