"""Which of the placements that look alike in depth has the colours that the camera saw.

A box is the same from its front and its back, a can whichever way it is turned: depth cannot tell,
and colour can.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import ColourConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import pixel_numbers
from brrp_cli.geometry import cells_of, transform_points, turns_about
from brrp_cli.prior.shape import StoredShape
from brrp_cli.registration.model import Model

Array = NDArray[np.float64]

# Lengths of principal axes in this ratio or less are alike; axes that are turned from the box's by
# less, radians, are the box's.
ALIKE, ASKEW = 1.05, 0.05


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


def about_main_axes(surface: Array, turns: int) -> Array:
    """(K, 4, 4) turns of a model about the principal axes of its surface (n, 3), both ways up, for
    those axes that are not alike and not the box's: a screwdriver that was scanned askew."""
    middle = surface.mean(axis=0)
    square, axes = np.linalg.eigh(np.cov((surface - middle).T))
    length = np.sqrt(square)
    angles = (np.arange(turns) * (2 * np.pi / turns))[:, None]
    found = []
    for i, axis in enumerate(axes.T):
        others = np.delete(length, i)
        alike = np.maximum(others, length[i]) / np.minimum(others, length[i]) < ALIKE
        if alike.any() or np.abs(axis).max() > np.cos(ASKEW):
            continue
        turned = Rotation.from_rotvec(angles * axis)
        over = Rotation.from_rotvec(np.pi * axes[:, i - 1])
        found += [turned.as_matrix(), (turned * over).as_matrix()]
    return turns_about(np.concatenate([np.zeros((0, 3, 3)), *found]), middle)


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


def colour_agreement(
    T_cam_model: Array,
    model: Model,
    frame: Frame,
    config: ColourConfig,
    lost: NDArray[np.bool_] | None = None,
) -> float:
    """Correlation of the colours that are stored and seen: see `_compared`."""
    return _compared(T_cam_model, model, frame, config, lost)[0]


def textured_agreement(
    T_cam_model: Array,
    model: Model,
    frame: Frame,
    config: ColourConfig,
    lost: NDArray[np.bool_] | None = None,
) -> float:
    """The same, less where there is little to compare: on a plain thing light and shadow decide."""
    correlation, contrast = _compared(T_cam_model, model, frame, config, lost)
    return correlation * min(1.0, contrast / config.textured) ** 2


def _compared(
    T_cam_model: Array,
    model: Model,
    frame: Frame,
    config: ColourConfig,
    lost: NDArray[np.bool_] | None,
) -> tuple[float, float]:
    """Correlation, -1 to 1, of the stored colours of what faces the camera, placed by T_cam_model
    (4, 4), with the image's at the same pixels; each channel about its own mean, so that the
    light's brightness and hue do not count. Both are means over cells of the surface: letters lie
    a little elsewhere. 0 where there is too little to see, or nothing but one colour. And the
    standard deviation of the stored colours, of 255.

    lost : (H, W) pixels of the object that have no depth, where that alone would be too few"""
    sample = _sampled(model.stored.shape, model.stored.half_extent, config.vertices, config.cell)
    # In the model's axes, where its normals are the same for all placements.
    camera = np.linalg.inv(T_cam_model)[:3, 3]
    facing = np.flatnonzero(sample.normals @ camera > sample.offsets)
    points = transform_points(T_cam_model, sample.points[facing])
    pixel, inside = pixel_numbers(points, frame)
    off = np.abs(frame.depth.ravel()[pixel] - points[:, 2])
    shown = off < config.near
    if lost is not None:
        shown |= lost.ravel()[pixel]
    near = np.flatnonzero(inside & shown)
    if len(near) < config.least_seen:
        return 0.0, 0.0
    seen = facing[near]
    cell = sample.cell[seen]
    count = np.bincount(cell)
    stored = _by_cell(sample.colours[seen], cell, count)
    image = _by_cell(frame.rgb.reshape(-1, 3)[pixel[near]], cell, count)
    spread = np.array([np.linalg.norm(stored), np.linalg.norm(image)])
    deviation = spread / np.sqrt(3 * len(seen))
    if deviation.min() < config.plain:
        return 0.0, float(deviation[0])
    return float((stored * image).sum() / spread.prod()), float(deviation[0])


@dataclass(frozen=True)
class _Sample:
    """Vertices of a stored mesh, metres, model's axes, whose colours are compared.

    points, normals : (n, 3); offsets : (n,) of the planes through them; colours : (n, 3) uint8;
    cell : (n,) number of the cell of the surface
    """

    points: Array
    normals: Array
    offsets: Array
    colours: NDArray[np.uint8]
    cell: NDArray[np.int64]


@lru_cache(maxsize=64)
def _sampled(shape: StoredShape, unit: float, vertices: int, cell: float) -> _Sample:
    """Of `vertices` vertices; unit : metres of one unit of the shape's coordinates."""
    rows = np.linspace(0, len(shape.vertices) - 1, vertices).astype(np.int64)
    points = shape.vertices[rows].astype(np.float64) * unit
    normals = shape.normals[rows]
    offsets = (points * normals).sum(axis=1)
    return _Sample(points, normals, offsets, shape.colours[rows], cells_of(points, cell))


def _by_cell(
    colours: NDArray[np.uint8], cell: NDArray[np.int64], count: NDArray[np.int64]
) -> Array:
    """Means (C, 3) of colours (n, 3) over C cells, about that of all, weighted so that the sum of
    squares is one over colours; 0 for a cell without any."""
    sums = np.stack([np.bincount(cell, weights=each) for each in colours.T], axis=-1)
    centred = sums / np.maximum(count, 1)[:, None] - sums.sum(axis=0) / len(colours)
    return np.asarray(centred * np.sqrt(count)[:, None])
