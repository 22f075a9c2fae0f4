"""Stretched and placed stances, many at once, and how far points lie from their surfaces.

x_plane = Rz(turn) diag(s, s, 1) diag(half) u + middle, with u the coordinates in the stance's box
and s = 1 + taper u_z, by which a shape widens upwards. The distance to a stretched surface is taken
to first order: f / |grad f|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.kin.coarse_loops import HALVES, coarse_distances
from brrp_cli.kin.library import Library

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class KinPlacements:
    """stance : (B,) rows of the library; turn : (B,) radians; middle, half : (B, 3) metres;
    taper : (B,)"""

    stance: NDArray[np.int64]
    turn: Floats
    middle: Floats
    half: Floats
    taper: Floats

    def __len__(self) -> int:
        return len(self.stance)

    def __getitem__(self, rows: NDArray[np.integer]) -> KinPlacements:
        return KinPlacements(
            self.stance[rows],
            self.turn[rows],
            self.middle[rows],
            self.half[rows],
            self.taper[rows],
        )

    def widened(self, u_z: Floats) -> Floats:
        """s (B, n) at heights u_z (B, n), which beyond the box counts as at its ends."""
        return 1 + self.taper[:, None] * np.clip(u_z, -1, 1)

    def to_box(self, points: Floats) -> Floats:
        """u (3, B, n) of points (n, 3), metres, frame of the plane."""
        c, s = np.cos(self.turn)[:, None], np.sin(self.turn)[:, None]
        x, y, z = (points[:, i] - self.middle[:, [i]] for i in range(3))
        u_z = z / self.half[:, [2]]
        wide = self.widened(u_z)
        turned = (
            (c * x + s * y) / (wide * self.half[:, [0]]),
            (c * y - s * x) / (wide * self.half[:, [1]]),
            u_z,
        )
        return np.stack(turned).astype(np.float32)

    def placed(self, points: Floats) -> Floats:
        """(3, B, n) metres, frame of the plane, of points u (B, n, 3)."""
        c, s = np.cos(self.turn)[:, None], np.sin(self.turn)[:, None]
        x, y, z = (points[:, :, i] * self.half[:, [i]] for i in range(3))
        wide = self.widened(points[:, :, 2])
        x, y = x * wide, y * wide
        return np.stack([c * x - s * y, s * x + c * y, z]) + self.middle.T[:, :, None]


def joined(each: list[KinPlacements]) -> KinPlacements:
    """All of them, in order."""
    columns = zip(*((p.stance, p.turn, p.middle, p.half, p.taper) for p in each), strict=True)
    return KinPlacements(*(np.concatenate(column) for column in columns))


def coarse_distance(placements: KinPlacements, points: Floats, library: Library) -> Floats:
    """Distance (B, n), metres, of points (n, 3), frame of the plane, from the coarse fields."""
    ratio = (library.half[placements.stance] / placements.half) ** 2
    return coarse_distances(
        placements.stance,
        placements.turn,
        placements.middle,
        placements.half,
        placements.taper,
        ratio,
        points,
        library.coarse.view(np.uint16),
        HALVES,
        round(library.coarse.shape[1] ** (1 / 3)),
        library.reach,
    )


def distance_and_slopes(
    placements: KinPlacements, points: Floats, library: Library
) -> tuple[Floats, Floats, Floats, Floats]:
    """Distance (B, n), metres, of points (n, 3); u (3, B, n); and the slope of the distance along u
    (3, B, n) and, unit, along the axes of the turned box (3, B, n)."""
    u = placements.to_box(points)
    stance, half = placements.stance, placements.half.T[:, :, None]
    local = np.matmul(library.to_object[stance], u.transpose(1, 0, 2)).transpose(1, 0, 2)
    local = local + library.origin[stance].T[:, :, None]
    value, gradient = library.fields.distance_and_gradient(library.object[stance], local)
    turned = library.to_object[stance].transpose(0, 2, 1)
    along = np.matmul(turned, gradient.transpose(1, 0, 2)).transpose(1, 0, 2)
    wide = placements.widened(u[2])
    sideways = along[0] * u[0] + along[1] * u[1]
    taper = np.where(np.abs(u[2]) < 1, placements.taper[:, None], 0)
    across = np.stack(
        [
            along[0] / (wide * half[0]),
            along[1] / (wide * half[1]),
            (along[2] - sideways * taper / wide) / half[2],
        ]
    )
    length = np.linalg.norm(across, axis=0)
    length = np.maximum(length, 1e-3 * np.abs(value) + 1e-6)
    return value / length, u, along / length, across / length
