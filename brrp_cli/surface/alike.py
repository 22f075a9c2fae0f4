"""Placements between those that are as probable as the best one.

Of an object that looks alike however it is turned, a few turns were held against the frame, not
all: the object may be turned by what lies between them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import turns_about
from brrp_cli.inference.placed_shape import PlacedShape

Array = NDArray[np.float64]


def every_alike(shape: PlacedShape, config: SurfaceConfig) -> Array:
    """(K, 4, 4) T_cam_shape of the placements that are as probable as the shape's own, and of those
    between: all turns about an axis where some neighbouring ones are alike, else the ways between
    neighbours."""
    if not len(shape.alike):
        return shape.alike
    free = _free_turns(shape, config)
    between = free if len(free) else _between_neighbours(shape, config)
    return np.concatenate([shape.alike, between])


def _free_turns(shape: PlacedShape, config: SurfaceConfig) -> Array:
    """Turns by `config.turn_step` about the axis that `config.free_turns` or more of the alike
    placements share, where two of them or the shape's own are `config.neighbours` apart or less.
    What is symmetric in steps, such as a box, has none so near."""
    start = Rotation.from_matrix(shape.T_cam_shape[:3, :3] / shape.unit)
    turned = start.inv() * Rotation.from_matrix(shape.alike[:, :3, :3] / shape.unit)
    vectors = turned.as_rotvec()
    angles = np.linalg.norm(vectors, axis=1)
    axes = vectors / angles[:, None]
    cosine = np.abs(axes @ axes.T)
    common = int(np.argmax((cosine > np.cos(config.one_axis)).sum(axis=1)))
    same = cosine[common] > np.cos(config.one_axis)
    about = np.sort(np.append(angles[same] * np.sign(axes[same] @ axes[common]), 0.0) % (2 * np.pi))
    gaps = np.diff(np.append(about, about[0] + 2 * np.pi))
    # Half turns about axes that all but agree are the same turn, and no step on the way round.
    gaps = gaps[gaps > config.one_axis]
    if len(gaps) <= config.free_turns or gaps.min() > config.neighbours:
        return np.empty((0, 4, 4))
    count = int(np.ceil(2 * np.pi / config.turn_step))
    every = 2 * np.pi / count * np.arange(1, count)
    turns = Rotation.from_rotvec(every[:, None] * axes[common]).as_matrix()
    # They turn about an axis that need not go through the middle of the shape's box.
    T_shape_alike = np.linalg.inv(shape.T_cam_shape) @ shape.alike[same]
    still = np.concatenate(np.eye(3) - T_shape_alike[:, :3, :3])
    middle = np.linalg.lstsq(still, T_shape_alike[:, :3, 3].ravel(), rcond=0.1)[0]
    return shape.T_cam_shape @ turns_about(turns, middle)


def _between_neighbours(shape: PlacedShape, config: SurfaceConfig) -> Array:
    """Steps on the ways from each placement to the three that are turned least from it, where that
    is no more than `config.neighbours`."""
    every = np.concatenate([shape.T_cam_shape[None], shape.alike])
    rotations = Rotation.from_matrix(every[:, :3, :3] / shape.unit)
    pairs = set()
    for number, rotation in enumerate(rotations):
        angles = (rotation.inv() * rotations).magnitude()
        near = np.argsort(angles, kind="stable")[1:4]
        pairs |= {
            (min(number, int(n)), max(number, int(n)))
            for n in near[angles[near] < config.neighbours]
        }
    found = [np.empty((0, 4, 4))]
    for pair in sorted(pairs):
        ends = rotations[list(pair)]
        angle = float((ends[0].inv() * ends[1]).magnitude())
        count = int(np.ceil(angle / config.turn_step))
        share = np.arange(1, count) / max(count, 1)
        T = _placed(Slerp([0, 1], ends)(share), shape)
        first, second = every[list(pair), :3, 3]
        T[:, :3, 3] = first + share[:, None] * (second - first)
        found.append(T)
    return np.concatenate(found)


def _placed(rotations: Rotation, shape: PlacedShape) -> Array:
    """(K, 4, 4) T_cam_shape with these rotations, where the shape's own stands."""
    matrices = rotations.as_matrix()
    T = np.tile(shape.T_cam_shape, (len(matrices), 1, 1))
    T[:, :3, :3] = matrices * shape.unit
    return np.asarray(T)
