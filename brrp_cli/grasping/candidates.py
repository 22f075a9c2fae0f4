"""Antipodal pairs of points on a surface, and the poses of a hand that closes on them.

Two points are antipodal when the line between them lies inside the friction cones of both
(Nguyen, "Constructing force-closure grasps", IJRR 1988): two soft contacts there hold any load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.geometry import normalise
from brrp_cli.grasping.draws import SurfaceDraws
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.observation.support_plane import Plane

Array = NDArray[np.float64]
# Metres that a ray starts off the surface that it leaves.
OFF = 2e-4


@dataclass(frozen=True)
class Pairs:
    """points : (n, 2, 3) metres, camera frame; tried, too_wide, not_antipodal : how many points
    were looked at, and how many of them have no partner, and why."""

    points: Array
    tried: int
    too_wide: int
    not_antipodal: int


def antipodal_pairs(
    surfaces: SurfaceDraws,
    points: int,
    gripper: Gripper,
    config: GraspConfig,
    rng: np.random.Generator,
) -> Pairs:
    """Antipodal pairs on drawn surfaces that the gripper spans, from about `points` points.

    From each point a ray goes through the object, within the friction cone. Its partner is where
    the ray first leaves the object, a wall, or where it leaves it for good, the whole object.
    """
    there = np.flatnonzero(surfaces.which >= 0)
    if not len(there):
        return Pairs(np.zeros((0, 2, 3)), 0, 0, 0)
    each = max(1, points // len(there))
    slope = np.arctan(config.friction)
    found, wide, slanted = [], 0, 0
    for draw in there:
        one = surfaces.only(np.array([draw]))
        start, normal = _surface_points(surfaces, int(draw), each, rng)
        way = _tilted(-normal, rng.random(each) * slope / 2, rng)
        through = rng.random(each) < 0.5
        most = gripper.opening - 2 * OFF
        begin = np.where(through[:, None], start + way * most, start + way * OFF)
        heading = np.where(through[:, None], -way, way)
        hit, facing = one.cast(begin[None], heading[None])
        hit = np.where(through, most - hit[0], hit[0] + OFF)
        # What begins inside a wide object meets its near side, or nothing, from within.
        inward = np.einsum("ni,ni->n", facing[0], way) <= 0
        outside = ~np.isfinite(hit) | (hit > most) | (hit < config.thinnest) | inward
        cosine = np.cos(slope)
        fits = np.einsum("ni,ni->n", -normal, way) >= cosine
        fits &= np.einsum("ni,ni->n", facing[0], way) >= cosine
        good = fits & ~outside
        wide += int(outside.sum())
        slanted += int((~outside & ~fits).sum())
        end = start[good] + way[good] * hit[good, None]
        found.append(np.stack([start[good], end], axis=1))
    pairs = np.concatenate(found)
    return Pairs(pairs, each * len(there), wide, slanted)


@dataclass(frozen=True)
class Poses:
    """T : (n, 4, 4) T_cam_gripper; openings : (n,) of the hand on its way in; contacts : (n, 2, 3)
    the pair that it was made for, metres, camera frame; order : (n,), 0 first, how deep it reaches
    among poses that differ in nothing else, which have the same `family` (n,)."""

    T: Array
    openings: Array
    contacts: Array
    order: NDArray[np.int64]
    family: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.T)

    def take(self, chosen: NDArray[np.integer] | NDArray[np.bool_]) -> Poses:
        """Those poses."""
        return Poses(
            self.T[chosen],
            self.openings[chosen],
            self.contacts[chosen],
            self.order[chosen],
            self.family[chosen],
        )


def hand_poses(pairs: Array, up: Array, gripper: Gripper, config: GraspConfig) -> Poses:
    """Hands that close on pairs (n, 2, 3): every approach around the line between the two, the
    steepest way down first, each with every reach."""
    if not len(pairs):
        none = np.zeros(0)
        whole = none.astype(np.int64)
        return Poses(np.zeros((0, 4, 4)), none, np.zeros((0, 2, 3)), whole, whole)
    x = normalise(pairs[:, 1] - pairs[:, 0])
    down = -up - (x @ -up)[:, None] * x
    # A pair above itself: any approach around it is as steep.
    level = np.linalg.norm(down, axis=1) < 0.05
    other = np.where(np.abs(up[0]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    aside = other - (x * other).sum(axis=1)[:, None] * x
    first = normalise(np.where(level[:, None], aside, down))
    second = np.cross(first, x)
    angle = np.linspace(0, 2 * np.pi, config.angles, endpoint=False)
    z = np.cos(angle)[:, None, None] * first + np.sin(angle)[:, None, None] * second
    reach = np.minimum(np.array(config.reaches), gripper.finger_length)
    shape = (len(angle), len(reach), len(pairs))
    T = np.zeros((*shape, 4, 4))
    T[..., 3, 3] = 1
    T[..., :3, 0] = x
    T[..., :3, 2] = z[:, None]
    T[..., :3, 1] = np.cross(T[..., :3, 2], T[..., :3, 0])
    back = (gripper.tip - reach)[None, :, None, None]
    T[..., :3, 3] = pairs.mean(axis=1) - back * T[..., :3, 2]
    width = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1)
    opening = np.minimum(width + 2 * config.clearance, gripper.opening)
    order = np.broadcast_to(np.arange(len(reach))[None, :, None], shape)
    family = np.arange(len(angle) * len(pairs)).reshape(len(angle), 1, len(pairs))
    count = int(np.prod(shape))
    return Poses(
        T.reshape(count, 4, 4),
        np.broadcast_to(opening, shape).reshape(count),
        np.broadcast_to(pairs, (*shape, 2, 3)).reshape(count, 2, 3),
        order.reshape(count),
        np.broadcast_to(family, shape).reshape(count),
    )


def lifted_off(
    poses: Poses, plane: Plane | None, gripper: Gripper, config: GraspConfig
) -> tuple[Poses, NDArray[np.bool_]]:
    """The same hands, pulled back along their approach where they would come closer to the table
    than `config.table_gap`, and which of them (n,) still reach beyond their pair by
    `config.least_reach`."""
    if plane is None or not len(poses):
        return poses, np.ones(len(poses), dtype=bool)
    height = gripper.lowest(poses.T, poses.openings, plane) - config.table_gap
    z = poses.T[:, :3, 2]
    sinks = -(z @ plane.normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        back = np.where(height < 0, -height / sinks, 0.0)
    middle = poses.contacts.mean(axis=1) - poses.T[:, :3, 3]
    reach = gripper.tip - np.einsum("ni,ni->n", middle, z) - back
    good = (back == 0) | ((sinks > 0.05) & (reach >= config.least_reach))
    T = poses.T.copy()
    T[good, :3, 3] -= back[good, None] * z[good]
    return replace(poses, T=T), good


def comes_from(T: Array, up: Array, steepest: float) -> NDArray[np.bool_]:
    """Which hands T_cam_gripper (n, 4, 4) approach at `steepest` degrees from straight down at
    most."""
    return np.asarray(T[:, :3, 2] @ -up >= np.cos(np.deg2rad(steepest)) - 1e-9)


def _surface_points(
    surfaces: SurfaceDraws, draw: int, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Points (count, 3) on a drawn surface, uniform over its area, and normals, camera frame."""
    mesh = surfaces.meshes[surfaces.which[draw]]
    corners = mesh.vertices[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    chosen = rng.choice(len(area), count, p=area / area.sum())
    u, v = rng.random((2, count, 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    a, b, c = corners[chosen].transpose(1, 0, 2)
    T_cam_mesh = np.linalg.inv(surfaces.T_mesh_cam[draw])
    points = (a + u * (b - a) + v * (c - a)) @ T_cam_mesh[:3, :3].T + T_cam_mesh[:3, 3]
    return points, normalise(cross[chosen]) @ T_cam_mesh[:3, :3].T


def _tilted(directions: Array, by: Array, rng: np.random.Generator) -> Array:
    """Unit directions (n, 3), each turned by an angle (n,), radians, to a random side."""
    aside = rng.normal(size=directions.shape)
    aside -= np.einsum("ni,ni->n", aside, directions)[:, None] * directions
    return np.cos(by)[:, None] * directions + np.sin(by)[:, None] * normalise(aside)
