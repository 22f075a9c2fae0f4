"""Points on surfaces of revolution, and on others, with their normals."""

from __future__ import annotations

import numpy as np

from brrp_cli.geometry import normalise


def frustum(bottom, top, height, *, count=1000, seen=np.pi, noise=0.0, seed=0):
    """(count, 3) points and unit normals of a cone's side about the z axis, from z = 0 to `height`,
    whose radius goes from `bottom` to `top`; over an angle of `seen` about +x. noise : of the
    normals."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-seen / 2, seen / 2, count)
    z = rng.uniform(0, height, count)
    radius = bottom + (top - bottom) * z / height
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    points = radius[:, None] * around + z[:, None] * [0, 0, 1]
    normals = normalise(height * around + (bottom - top) * np.array([0, 0, 1.0]))
    return points, normalise(normals + rng.normal(0, max(noise, 1e-12), normals.shape))


def two_faces(width, height, *, count=1000, seed=0):
    """The same of the two faces of an upright box that look to +x and +y."""
    rng = np.random.default_rng(seed)
    along, z = rng.uniform(-width / 2, width / 2, count), rng.uniform(0, height, count)
    first = np.arange(count) < count // 2
    x = np.where(first, width / 2, along)
    y = np.where(first, along, width / 2)
    normals = np.where(first[:, None], [1.0, 0, 0], [0, 1.0, 0])
    return np.stack([x, y, z], axis=1), normals


def turned_and_moved(points, normals, seed=0):
    """The same elsewhere and otherwise turned, and the (4, 4) transform that did it."""
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T[:3, 3] = [0.1, -0.2, 0.8]
    return points @ T[:3, :3].T + T[:3, 3], normals @ T[:3, :3].T, T
