"""Stretched and placed stances, many at once, and how far points lie from their surfaces.

x_plane = Rz(turn) diag(half) u + middle, with u the coordinates in the stance's box. The distance
to a stretched surface is taken to first order: f / |grad f|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.kin.library import Library

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Placements:
    """stance : (B,) rows of the library; turn : (B,) radians; middle, half : (B, 3) metres."""

    stance: NDArray[np.int64]
    turn: Floats
    middle: Floats
    half: Floats

    def __len__(self) -> int:
        return len(self.stance)

    def __getitem__(self, rows: NDArray[np.integer]) -> Placements:
        return Placements(self.stance[rows], self.turn[rows], self.middle[rows], self.half[rows])

    def to_box(self, points: Floats) -> Floats:
        """u (3, B, n) of points (n, 3), metres, frame of the plane."""
        c, s = np.cos(self.turn)[:, None], np.sin(self.turn)[:, None]
        x, y, z = (points[:, i] - self.middle[:, [i]] for i in range(3))
        turned = np.stack([c * x + s * y, c * y - s * x, z])
        return np.asarray(turned / self.half.T[:, :, None], dtype=np.float32)

    def placed(self, points: Floats) -> Floats:
        """(3, B, n) metres, frame of the plane, of points u (B, n, 3)."""
        c, s = np.cos(self.turn)[:, None], np.sin(self.turn)[:, None]
        x, y, z = (points[:, :, i] * self.half[:, [i]] for i in range(3))
        return np.stack([c * x - s * y, s * x + c * y, z]) + self.middle.T[:, :, None]


def joined(each: list[Placements]) -> Placements:
    """All of them, in order."""
    columns = zip(*((p.stance, p.turn, p.middle, p.half) for p in each), strict=True)
    return Placements(*(np.concatenate(column) for column in columns))


def coarse_distance(placements: Placements, points: Floats, library: Library) -> Floats:
    """Distance (B, n), metres, of points (n, 3), frame of the plane, from the coarse fields."""
    nodes = round(library.coarse.shape[1] ** (1 / 3))
    u = placements.to_box(points)
    step = (nodes - 1) / (2 * library.reach)
    cell = np.clip(np.rint((u + library.reach) * step), 0, nodes - 1).astype(np.int64)
    number = (cell[0] * nodes + cell[1]) * nodes + cell[2]
    number += placements.stance[:, None] * nodes**3
    # Rows of eight bytes: one look-up for each point.
    found = library.coarse.reshape(-1, 4).view(np.uint64).ravel().take(number)
    value = found.view(np.float16).reshape(*number.shape, 4).astype(np.float32)
    ratio = (library.half[placements.stance] / placements.half) ** 2
    steepness = np.einsum("bnc,bc->bn", value[..., 1:], ratio)
    distance = value[..., 0] / np.sqrt(np.maximum(steepness, 1e-6))
    # Off the grid, the way to it on top.
    over = np.maximum(np.abs(u) - library.reach, 0) * placements.half.T[:, :, None]
    return np.asarray(distance + np.sqrt(np.square(over).sum(axis=0)))


def distance_and_slopes(
    placements: Placements, points: Floats, library: Library
) -> tuple[Floats, Floats, Floats]:
    """Distance (B, n), metres, of points (n, 3) or (B, n, 3); u (3, B, n); and the slope of the
    distance along u (3, B, n)."""
    u = placements.to_box(points)
    stance = placements.stance
    M, origin = library.to_object[stance], library.origin[stance]
    local = np.einsum("bij,jbn->ibn", M, u) + origin.T[:, :, None]
    value, gradient = library.fields.distance_and_gradient(library.object[stance], local)
    along = np.einsum("bij,ibn->jbn", M, gradient)
    length = np.linalg.norm(along / placements.half.T[:, :, None], axis=0)
    length = np.maximum(length, 1e-3 * np.abs(value) + 1e-6)
    return value / length, u, along / length
