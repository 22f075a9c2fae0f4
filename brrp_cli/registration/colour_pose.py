"""Which of the placements that look alike in depth has the colours that the camera saw.

A box is the same from its front and its back, a can whichever way it is turned: depth cannot tell,
and colour can. Light makes one side of it darker than the other, and may have fallen from elsewhere
when the object was scanned: how bright a side is as a whole tells nothing of how it is turned.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from brrp_cli.config import ColourConfig
from brrp_cli.config.registration import MainAxesConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import pixel_numbers
from brrp_cli.geometry import cells_of, transform_points, turns_about
from brrp_cli.prior.shape import StoredShape
from brrp_cli.registration.model import Model

Array = NDArray[np.float64]

# Brightness, red against green, both against blue: unit vectors at right angles.
_OPPONENT = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 0.0], [0.5, 0.5, -1.0]])
_OPPONENT /= np.linalg.norm(_OPPONENT, axis=1, keepdims=True)


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


def print_agreement(
    T_cam_model: Array,
    model: Model,
    frame: Frame,
    config: ColourConfig,
    lost: NDArray[np.bool_] | None = None,
) -> float:
    """Correlation, -1 to 1, of the stored colours of what faces the camera, placed by T_cam_model
    (4, 4), with the image's at the same pixels; each channel about its own mean, and brightness
    about that of each side of its box, so that how light falls on it does not count. Less where
    there is little to compare: on a plain thing light and shadow decide. 0 where too little is seen
    or nothing is printed. Of an image without hue, brightness alone.

    lost : (H, W) pixels of the object that have no depth, where that alone would be too few"""
    seen = _seen(T_cam_model, model, frame, config, lost)
    if seen is None:
        return 0.0
    channels = 1 if frame.hueless else 3
    stored, image = (_unshaded(each, seen.side)[:, :channels] for each in (seen.stored, seen.image))
    correlation, contrast = _correlation(stored, image, seen.cell, config.unprinted)
    return correlation * min(1.0, contrast / config.printed) ** 2


@dataclass(frozen=True)
class _Seen:
    """Vertices that the camera sees: stored and image (n, 3), their colours; cell (n,) of the
    surface; side (n,), 0 to 5, of the box that they face."""

    stored: Array
    image: Array
    cell: NDArray[np.int64]
    side: NDArray[np.int64]


def _seen(
    T_cam_model: Array,
    model: Model,
    frame: Frame,
    config: ColourConfig,
    lost: NDArray[np.bool_] | None,
) -> _Seen | None:
    """Of a model placed by T_cam_model (4, 4); None where these are too few."""
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
        return None
    rows = facing[near]
    return _Seen(
        sample.colours[rows].astype(np.float64),
        frame.rgb.reshape(-1, 3)[pixel[near]].astype(np.float64),
        sample.cell[rows],
        sample.side[rows],
    )


def _unshaded(colours: Array, side: NDArray[np.int64]) -> Array:
    """Colours (n, 3) as brightness, about the mean of each side (n,), and two of hue."""
    found = colours @ _OPPONENT.T
    bright = np.bincount(side, weights=found[:, 0]) / np.maximum(np.bincount(side), 1)
    found[:, 0] -= bright[side]
    return np.asarray(found)


def _correlation(
    stored: Array, image: Array, cell: NDArray[np.int64], plain: float
) -> tuple[float, float]:
    """Of colours (n, 3), and the standard deviation of the stored ones, of 255. They are means over
    cells (n,) of the surface: letters lie a little elsewhere. 0 where either is `plain`."""
    count = np.bincount(cell)
    one, other = (_by_cell(each, cell, count) for each in (stored, image))
    spread = np.array([np.linalg.norm(one), np.linalg.norm(other)])
    deviation = spread / np.sqrt(3 * len(cell))
    if deviation.min() < plain:
        return 0.0, float(deviation[0])
    return float((one * other).sum() / spread.prod()), float(deviation[0])


@dataclass(frozen=True)
class _Sample:
    """Vertices of a stored mesh, metres, model's axes, whose colours are compared.

    points, normals : (n, 3); offsets : (n,) of the planes through them; colours : (n, 3) uint8;
    cell : (n,) number of the cell of the surface; side : (n,) of the box, 0 to 5, which they face
    """

    points: Array
    normals: Array
    offsets: Array
    colours: NDArray[np.uint8]
    cell: NDArray[np.int64]
    side: NDArray[np.int64]


@lru_cache(maxsize=64)
def _sampled(shape: StoredShape, unit: float, vertices: int, cell: float) -> _Sample:
    """Of `vertices` vertices; unit : metres of one unit of the shape's coordinates."""
    rows = np.linspace(0, len(shape.vertices) - 1, vertices).astype(np.int64)
    points = shape.vertices[rows].astype(np.float64) * unit
    normals = shape.normals[rows]
    offsets = (points * normals).sum(axis=1)
    axis = np.abs(normals).argmax(axis=1)
    side = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0)
    return _Sample(points, normals, offsets, shape.colours[rows], cells_of(points, cell), side)


def _by_cell(colours: Array, cell: NDArray[np.int64], count: NDArray[np.int64]) -> Array:
    """Means (C, 3) of colours (n, 3) over C cells, about that of all, weighted so that the sum of
    squares is one over colours; 0 for a cell without any."""
    sums = np.stack([np.bincount(cell, weights=each) for each in colours.T], axis=-1)
    centred = sums / np.maximum(count, 1)[:, None] - sums.sum(axis=0) / len(colours)
    return np.asarray(centred * np.sqrt(count)[:, None])
