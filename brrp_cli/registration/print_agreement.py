"""What is printed on a placed object, held against the image.

A box is the same from its front and its back, a can whichever way it is turned: depth cannot tell,
and colour can. Light makes one side of it darker than the other, and may have fallen from elsewhere
when the object was scanned: neither how bright it is nor how brightness changes with the way a
surface faces tells how it is turned, or which of two fruits it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import ColourConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import cells_of
from brrp_cli.prior.shape import StoredShape
from brrp_cli.registration.model import Model
from brrp_cli.registration.print_loops import agreements

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Brightness, red against green, both against blue: unit vectors at right angles.
_OPPONENT = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 0.0], [0.5, 0.5, -1.0]])
_OPPONENT /= np.linalg.norm(_OPPONENT, axis=1, keepdims=True)
# Of 255: where a step has the size on the scale of logarithms that it has on that of the image.
_MIDDLE = 128.0


def _logarithms(values: Array, dark: float) -> Array:
    """Of values of 255, above `dark` for the most part. Light multiplies all channels: of their
    logarithms it changes brightness alone."""
    return (dark + _MIDDLE) * np.log((dark + values) / (dark + _MIDDLE))


@lru_cache
def _curve(dark: float) -> Array:
    """(256,) the same of what an image may hold."""
    return _logarithms(np.arange(256.0), dark)


@dataclass(frozen=True)
class Agreement:
    """Of placements (B,): correlation, -1 to 1, of the stored colours with the image's; contrast,
    of 255, of what is stored; cells : of the surface that the camera sees. 0 where too little is
    seen or nothing is printed."""

    correlation: Array
    contrast: Array
    cells: Array


def print_agreement(
    T_cam_model: Array,
    model: Model,
    frame: Frame,
    config: ColourConfig,
    lost: Mask | None = None,
) -> float:
    """Correlation, -1 to 1, of the stored colours of what faces the camera, placed by T_cam_model
    (4, 4), with the image's at the same pixels. Less where there is little to compare: on a plain
    thing light and shadow decide. 0 where too little is seen or nothing is printed.

    lost : (H, W) pixels of the object that have no depth, where that alone would be too few"""
    found = agreement(T_cam_model[None], model, frame, config, config.cell, config.vertices, lost)
    return float((found.correlation * how_printed(found, config))[0])


def how_printed(found: Agreement, config: ColourConfig) -> Array:
    """(B,) 0 to 1: how much there is to compare."""
    return np.asarray(np.minimum(1.0, found.contrast / config.printed) ** 2)


def agreement(
    T_cam_model: Array,
    model: Model,
    frame: Frame,
    config: ColourConfig,
    cell: float,
    vertices: int,
    lost: Mask | None = None,
) -> Agreement:
    """Of placements T_cam_model (B, 4, 4), of one size, in cells of `cell` metres, of at most
    `vertices` vertices. Colours are means over cells, since letters lie a little elsewhere; each
    channel about its own mean, and brightness about what is linear in the normals, as diffuse light
    from one side is, so that how light falls on it does not count. Of an image without hue,
    brightness alone.

    lost : as in `print_agreement`"""
    dark, hueless = config.dark, frame.hueless
    shape, unit = model.stored.shape, model.stored.half_extent
    sample = _sampled(shape, unit, vertices, cell, dark, hueless)
    correlation, stored, image, cells = agreements(
        np.ascontiguousarray(T_cam_model),
        sample.points,
        sample.normals,
        sample.offsets,
        sample.colours,
        sample.cell,
        frame.rgb,
        frame.depth,
        np.zeros(frame.shape, np.bool_) if lost is None else lost,
        frame.K,
        _OPPONENT,
        _curve(dark),
        config.near,
        config.least_seen,
        1 if hueless else 3,
    ).T
    printed = np.minimum(stored, image) >= config.unprinted
    return Agreement(np.where(printed, correlation, 0.0), np.where(printed, stored, 0.0), cells)


@dataclass(frozen=True)
class _Sample:
    """Vertices of a stored mesh, metres, model's axes, whose colours are compared.

    points, normals : (n, 3); offsets : (n,) of the planes through them; colours : (n, 3), their
    logarithms, along `_OPPONENT`; cell : (n,) number of the cell of the surface
    """

    points: Array
    normals: Array
    offsets: Array
    colours: Array
    cell: NDArray[np.int64]


@lru_cache(maxsize=128)
def _sampled(
    shape: StoredShape, unit: float, vertices: int, cell: float, dark: float, hueless: bool
) -> _Sample:
    """Of `vertices` vertices; unit : metres of one unit of the shape's coordinates; dark : as in
    `_logarithms`; hueless : as a camera sees them that tells no hues apart."""
    rows = np.linspace(0, len(shape.vertices) - 1, vertices).astype(np.int64)
    points = shape.vertices[rows].astype(np.float64) * unit
    normals = shape.normals[rows].astype(np.float64)
    offsets = (points * normals).sum(axis=1)
    colours = shape.colours[rows].astype(np.float64)
    if hueless:
        colours[:] = colours.mean(axis=1, keepdims=True)
    along = _logarithms(colours, dark) @ _OPPONENT.T
    return _Sample(points, normals, offsets, along, cells_of(points, cell))
