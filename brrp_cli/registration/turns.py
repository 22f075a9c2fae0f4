"""Turns of a model about itself, and which of them are tried."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config.turns import MainAxesConfig
from brrp_cli.geometry import turns_about

Array = NDArray[np.float64]


@cache
def turns_about_itself(turns: int) -> Array:
    """(K, 3, 3) turns of a model about each axis of its box, both ways up, each once: those under
    which a box, a can or a bottle looks alike, among others. The first is none."""
    angles = np.arange(turns) * (2 * np.pi / turns)
    found = [np.eye(3)[None]]
    for axis, other in (("z", "x"), ("y", "z"), ("x", "y")):
        about = Rotation.from_euler(axis, angles[:, None])
        for flip in (Rotation.identity(), Rotation.from_euler(other, np.pi)):
            found.append((about * flip).as_matrix())
    every = np.concatenate(found)
    rounded = np.round(every, 6) + 0.0
    first = np.unique(rounded.reshape(len(every), -1), axis=0, return_index=True)[1]
    return np.asarray(every[np.sort(first)])


def about_main_axes(surface: Array, turns: int, config: MainAxesConfig) -> Array:
    """(K, 4, 4) turns of a model about the principal axes of its surface (n, 3), both ways up, for
    those axes that are not alike and not the box's: a screwdriver that was scanned askew."""
    middle = surface.mean(axis=0)
    square, axes = np.linalg.eigh(np.cov((surface - middle).T))
    length = np.sqrt(square)
    angles = (np.arange(turns) * (2 * np.pi / turns))[:, None]
    found = []
    for i, axis in enumerate(axes.T):
        others = np.delete(length, i)
        alike = np.maximum(others, length[i]) / np.minimum(others, length[i]) < config.alike
        if alike.any() or np.abs(axis).max() > np.cos(config.askew):
            continue
        turned = Rotation.from_rotvec(angles * axis)
        over = Rotation.from_rotvec(np.pi * axes[:, i - 1])
        found += [turned.as_matrix(), (turned * over).as_matrix()]
    return turns_about(np.concatenate([np.zeros((0, 3, 3)), *found]), middle)


def motions(steps: Array, middle: Array) -> Array:
    """(B, 4, 4) turns about a point `middle` (3,) by steps[:, :3], radians, followed by shifts by
    steps[:, 3:] (B, 6), metres."""
    found = turns_about(Rotation.from_rotvec(steps[:, :3]).as_matrix(), middle)
    found[:, :3, 3] += steps[:, 3:]
    return found


def best_and_different(turns: Array, score: Array, count: int, apart: float) -> NDArray[np.int64]:
    """Rows of the `count` best of turns (K, 3, 3), first those that are `apart` radians or more
    from all better ones: the front of a box is not to be crowded out by its back, turned a
    little."""
    order = np.argsort(-score, kind="stable")
    # The trace of the turn between two is 1 + 2 cos of its angle.
    flat = turns.reshape(-1, 9)
    near = (flat @ flat.T - 1) / 2 > np.cos(apart) + 1e-9
    crowded = np.zeros(len(turns), dtype=np.bool_)
    different: list[int] = []
    for row in order:
        if not crowded[row]:
            different.append(int(row))
            crowded |= near[row]
        if len(different) == count:
            break
    taken = set(different)
    rest = [row for row in order if row not in taken]
    return np.array([*different, *rest][:count], dtype=np.int64)


def without_same(T: Array, turn: float, shift: float) -> Array:
    """Placements (B, 4, 4), best first, of one size, without those that are turned from a better
    one by less than `turn`, radians, and shifted by less than `shift`, metres."""
    if not len(T):
        return T
    R, t = T[:, :3, :3].reshape(-1, 9), T[:, :3, 3]
    # The trace of the turn between two is 1 + 2 cos of its angle.
    trace = R @ R.T / (R[0] @ R[0] / 3)
    apart = np.linalg.norm(t[:, None] - t, axis=2)
    same = (trace > 1 + 2 * np.cos(turn)) & (apart < shift)
    kept = np.ones(len(same), dtype=np.bool_)
    for row in range(len(same)):
        if kept[row]:
            kept[row + 1 :] &= ~same[row, row + 1 :]
    return np.asarray(T[kept])
