"""How well hands hold an object whose weight and middle are guessed from its mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.grasping.candidates import Poses
from brrp_cli.grasping.closing import Closed
from brrp_cli.grasping.scene import GraspObject
from brrp_cli.physics import GRAVITY

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def carries(poses: Poses, closed: Closed, item: GraspObject, config: GraspConfig) -> Array:
    """(n,) how probably friction holds the weight of an object about the closing axis."""
    mass = max(config.lightest, config.density * _centre(item)[1])
    return np.exp(-mass * GRAVITY * _levers(poses, closed, item) / config.torque)


def quality(poses: Poses, closed: Closed, item: GraspObject, config: GraspConfig) -> Array:
    """(n,) in [0, 1], what friction, contact and lever leave: how far inside the friction cone, how
    much of the fingers touches, how close the closing axis passes the object's middle; means over
    the draws by how probably it holds in each, 0 where it holds in none."""
    holds = closed.holds
    count = np.maximum(holds.sum(axis=0), 1e-9)
    least = np.cos(np.arctan(config.friction))
    inside = np.clip((closed.margin - least) / (1 - least), 0, 1)
    # A quarter of the faces is a good contact already.
    touching = np.minimum(closed.touching * 4, 1)
    value = (holds * (0.5 + 0.5 * inside) * (0.5 + 0.5 * touching)).sum(axis=0) / count
    return np.asarray(value * np.exp(-_levers(poses, closed, item) / config.lever))


def _levers(poses: Poses, closed: Closed, item: GraspObject) -> Array:
    """(n,) metres, distances of the closing axes from the object's centre."""
    x = poses.T[:, :3, 0]
    met: Flags = np.asarray(np.isfinite(closed.contacts).all(axis=(-1, -2)))[..., None]
    local = np.where(met, closed.contacts.mean(axis=2), 0).sum(axis=0) / np.maximum(
        met.sum(axis=0), 1
    )
    placed = np.einsum("nij,nj->ni", poses.T[:, :3, :3], local) + poses.T[:, :3, 3]
    aside = _centre(item)[0] - np.where(met.any(axis=0), placed, poses.contacts.mean(axis=1))
    aside = aside - np.einsum("ni,ni->n", aside, x)[:, None] * x
    return np.asarray(np.linalg.norm(aside, axis=1))


def _centre(item: GraspObject) -> tuple[Array, float]:
    """(3,) centroid of the volume of a closed mesh, and the volume, cubic metres."""
    origin = item.vertices.mean(axis=0)
    a, b, c = (item.vertices[item.faces] - origin).transpose(1, 0, 2)
    volumes = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6
    total = float(volumes.sum())
    if total <= 0:
        return np.asarray(origin), 0.0
    return np.asarray(origin + (volumes @ (a + b + c)) / (4 * total)), total
