"""What happens when a hand comes in and closes on drawn surfaces of an object.

On its way in the hand must not touch the object: rays along the approach find what the fingers and
the palm would run into. Then the fingers close: rays from their inner faces find what each meets
first, and what lies so little behind that it touches too. The grasp holds where the line between
the middles of the two contacts lies inside the friction cones of both, and so does the direction in
which the fingers press. Further outside it holds the less probably: what is held askew turns until
it lies flat between the fingers, or slips out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.geometry import normalise
from brrp_cli.grasping.draws import SurfaceDraws
from brrp_cli.grasping.gripper import Gripper

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Closed:
    """For each draw and hand, (S, n).

    collides : the open hand runs into the object on its way in; misses : a finger meets nothing
    slips : how probably friction does not hold an object that both fingers meet
    contacts : (S, n, 2, 3), middles of the contacts, gripper's frame, NaN where there are none
    touching : share of the fingers' faces that touch; margin : cosine of the worst angle to a
    contact's normal
    """

    collides: Flags
    misses: Flags
    slips: Array
    contacts: Array
    touching: Array
    margin: Array

    @property
    def holds(self) -> Array:
        """(S, n) how probably none of these goes wrong."""
        return np.where(self.collides | self.misses, 0.0, 1 - self.slips)


def close_on(
    surfaces: SurfaceDraws,
    T_cam_gripper: Array,
    openings: Array,
    gripper: Gripper,
    config: GraspConfig,
    off: Array | None = None,
) -> Closed:
    """Hands T_cam_gripper (n, 4, 4), open by `openings` (n,), metres, on each of S draws.

    off : (S, 4, 4), where the hand gets to in each draw, in its own frame
    """
    T = _placed(surfaces, T_cam_gripper, off)
    press, side = _closing_rays(openings, gripper, config)
    # What a finger only grazes is pushed aside: it may lie a little within the open finger.
    hit, normals = _cast(surfaces, T, press - config.grazes * side, side)
    hit = hit - config.grazes
    collides = runs_into(
        surfaces, T_cam_gripper, openings, gripper, config, off, inset=config.grazes
    )
    return _pressed(hit, normals, press, openings, collides, config)


def runs_into(
    surfaces: SurfaceDraws,
    T_cam_gripper: Array,
    openings: Array,
    gripper: Gripper,
    config: GraspConfig,
    off: Array | None = None,
    *,
    inset: float,
) -> Flags:
    """Which hands touch each of S draws on their way in: (S, n), as `close_on` takes them. Their
    boxes are smaller by `inset` metres on each side.

    Rays tell it: what they find is there, and they miss what is thinner than the space between
    them.
    """
    T = _placed(surfaces, T_cam_gripper, off)
    sweep, length = _sweep_rays(openings, gripper, config.approach, inset)
    hit, _ = _cast(surfaces, T, sweep, np.broadcast_to([0.0, 0.0, 1.0], sweep.shape[1:]))
    return np.asarray((hit < length).any(axis=-1))


def _placed(surfaces: SurfaceDraws, T_cam_gripper: Array, off: Array | None) -> Array:
    """(S, n, 4, 4), where each hand gets to in each draw."""
    if off is None:
        return np.broadcast_to(T_cam_gripper, (len(surfaces), *T_cam_gripper.shape))
    return np.asarray(T_cam_gripper[None] @ off[:, None])


def _cast(surfaces: SurfaceDraws, T: Array, origins: Array, along: Array) -> tuple[Array, Array]:
    """Distances (S, n, k) and normals (S, n, k, 3), gripper's frame, of rays from origins
    (n, k, 3) along (k, 3), gripper's frame, of hands T (S, n, 4, 4)."""
    back = np.swapaxes(T[..., :3, :3], -1, -2)
    placed = origins[None] @ back + T[..., None, :3, 3]
    heading = along @ back
    shape = placed.shape
    flat = (shape[0], shape[1] * shape[2], 3)
    hit, facing = surfaces.cast(placed.reshape(flat), heading.reshape(flat))
    # R' n as a row is n R.
    return hit.reshape(shape[:3]), facing.reshape(shape) @ T[..., :3, :3]


def _pressed(
    hit: Array, normals: Array, start: Array, openings: Array, collides: Flags, config: GraspConfig
) -> Closed:
    """From distances (S, n, 2 k), normals (S, n, 2 k, 3) and origins (n, 2 k, 3) of the closing
    rays, the left finger's first."""
    draws, hands, rays = hit.shape
    hit = np.where(hit < openings[None, :, None], hit, np.inf)
    half = hit.reshape(draws, hands, 2, rays // 2)
    first = half.min(axis=-1, keepdims=True)
    misses = ~np.isfinite(first[..., 0]).all(axis=-1)
    touches = np.isfinite(half) & (half <= first + config.yields)
    weight = touches / np.maximum(touches.sum(axis=-1, keepdims=True), 1)
    press = np.array([1.0, -1.0])
    reached = np.where(touches, half, 0.0) * press[:, None]
    place = np.repeat(start[None].reshape(1, hands, 2, rays // 2, 3), draws, axis=0)
    place[..., 0] += reached
    contacts = np.einsum("snfk,snfki->snfi", weight, place)
    facing = normalise(
        np.einsum("snfk,snfki->snfi", weight, normals.reshape(draws, hands, 2, rays // 2, 3))
    )
    line = normalise(contacts[:, :, 1] - contacts[:, :, 0])
    # Against the line between the contacts, and against the direction of closing.
    angles = np.stack(
        [
            np.einsum("sni,sni->sn", -facing[:, :, 0], line),
            np.einsum("sni,sni->sn", facing[:, :, 1], line),
            -facing[:, :, 0, 0],
            facing[:, :, 1, 0],
        ]
    )
    margin = np.where(misses, -1.0, angles.min(axis=0))
    outside = np.clip(1 - margin / np.cos(np.arctan(config.friction)), 0, 1)
    slips = np.where(margin > 0, (1 - config.askew) * outside, 1.0)
    return Closed(
        collides,
        misses & ~collides,
        np.where(misses | collides, 0.0, slips),
        np.where(misses[..., None, None], np.nan, contacts),
        touches.mean(axis=(-1, -2)),
        margin,
    )


def _sweep_rays(
    openings: Array, gripper: Gripper, approach: float, inset: float
) -> tuple[Array, Array]:
    """Origins (n, k, 3), gripper's frame, of rays along +z through what the hand sweeps, and how
    far (k,) each is swept."""
    boxes = gripper.boxes(openings, approach)
    origins, lengths = [], []
    for part, (columns, rows) in enumerate(((3, 3), (3, 3), (5, 3))):
        low, high = boxes[:, part, 0], boxes[:, part, 1]
        u = np.linspace(0, 1, columns)[None, :, None]
        v = np.linspace(0, 1, rows)[None, None, :]
        x = (low[:, 0] + inset)[:, None, None] + u * (high - low)[:, 0, None, None]
        x = x - 2 * inset * u
        y = (low[:, 1] + inset)[:, None, None] + v * (high - low)[:, 1, None, None]
        y = y - 2 * inset * v
        shape = (len(boxes), columns, rows)
        z = np.broadcast_to(low[:, 2, None, None], shape)
        xyz = np.stack([np.broadcast_to(x, shape), np.broadcast_to(y, shape), z], axis=-1)
        origins.append(xyz.reshape(len(boxes), columns * rows, 3))
        depth = (high - low)[0, 2] if len(boxes) else 0.0
        lengths.append(np.full(columns * rows, depth))
    return np.concatenate(origins, axis=1), np.concatenate(lengths)


def _closing_rays(openings: Array, gripper: Gripper, config: GraspConfig) -> tuple[Array, Array]:
    """Origins (n, 2 k, 3), gripper's frame, on the inner faces of the fingers, the left one's
    first, and where they head (2 k, 3): across to the other finger."""
    rows, columns = config.pad_rows, config.pad_columns
    # Each ray stands for an equal part of the face.
    along = (np.arange(rows) + 0.5) / rows
    across = (np.arange(columns) + 0.5) / columns - 0.5
    z, y = np.meshgrid(
        gripper.palm_length + along * gripper.finger_length, across * gripper.finger_width
    )
    count = rows * columns
    origins = np.empty((len(openings), 2 * count, 3))
    origins[..., 1], origins[..., 2] = np.tile(y.ravel(), 2), np.tile(z.ravel(), 2)
    origins[:, :count, 0], origins[:, count:, 0] = -openings[:, None] / 2, openings[:, None] / 2
    side = np.zeros((2 * count, 3))
    side[:count, 0], side[count:, 0] = 1.0, -1.0
    return origins, side
