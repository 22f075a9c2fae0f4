"""Views whose depth is known: a wall, and a wall with a box before it."""

import numpy as np

from brrp_cli.depth_noise.view import View

SHAPE = (240, 320)
K = np.array([[580.0, 0, 159.5], [0, 580.0, 119.5], [0, 0, 1]])
BOX = (slice(60, 180), slice(110, 210))


def facing(depth, albedo=0.6, gloss=0.0):
    """A view of surfaces that face the camera, depth (H, W); albedo and gloss may be images."""
    normals = np.zeros((*depth.shape, 3))
    normals[..., 2] = -1
    full = np.ones(depth.shape)
    return View(depth.astype(float), K, normals, full * albedo, full * gloss)


def wall(distance=0.9):
    return np.full(SHAPE, distance)


def wall_and_box(far=0.9, near=0.7):
    depth = wall(far)
    depth[BOX] = near
    return depth
