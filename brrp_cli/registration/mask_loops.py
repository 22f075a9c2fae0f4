"""Placements shifted until their outlines are a mask's, as machine code. See `compiled`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.compiled import compiled

Array = NDArray[np.float64]

# Metres; what is nearer to the camera is not seen.
NEAREST = 0.01


@compiled
def shifted(
    T_plane_model: Array,
    surface: Array,
    T_cam_plane: Array,
    K: Array,
    eye: Array,
    ray: Array,
    reach: Array,
    cut: Array,
    directions: Array,
    steps: int,
) -> tuple[Array, Array]:
    """Placements (B, 4, 4) of a surface (n, 3) shifted along the plane towards a mask in some
    steps, and by how many pixels the reach of each then differs from it (B,), on average; inf for
    what is then behind the camera.

    eye, ray : (3,) of the camera, and through the mask's middle, downwards, in the plane's frame
    reach : (d,) pixels, of the mask along `directions` (d, 2), evenly spread; cut : (d,) 1 where it
    may go on, so that a placement that reaches further does not differ from it, 0 elsewhere
    """
    T = T_plane_model.copy()
    off = np.empty(len(T))
    places, pixels = np.empty((3, len(surface))), np.empty((2, len(surface)))
    x, y = directions[:, 0].copy(), directions[:, 1].copy()
    most, gap = np.empty(len(x)), np.empty(len(x))
    for b in range(len(T)):
        _lay_below(T[b], surface, eye, ray)
        for step in range(steps + 1):
            if step:
                _close(T[b], places, gap, directions, T_cam_plane, K)
            seen = _project(T_cam_plane @ T[b], surface, K, places, pixels)
            most[:] = -np.inf
            for n in range(len(surface)):
                u, v = pixels[0, n], pixels[1, n]
                # Directions are the inner loop, so that several maxima are taken at a time.
                for d in range(len(x)):
                    most[d] = max(most[d], x[d] * u + y[d] * v)
            for d in range(len(x)):
                gap[d] = reach[d] - most[d]
                if cut[d] > 0:
                    gap[d] = max(gap[d], 0.0)
        off[b] = np.abs(gap).mean() if seen else np.inf
    return T, off


@compiled
def _lay_below(T: Array, surface: Array, eye: Array, ray: Array) -> None:
    """Move a placement (4, 4), in place, along the plane: the middle of its box is where the ray
    is half as high as it."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for n in range(len(surface)):
        for axis in range(3):
            at = T[axis, 3] if axis == 2 else 0.0
            for i in range(3):
                at += T[axis, i] * surface[n, i]
            low[axis], high[axis] = min(low[axis], at), max(high[axis], at)
    way = (high[2] / 2 - eye[2]) / ray[2]
    for axis in range(2):
        T[axis, 3] = eye[axis] + way * ray[axis] - (low[axis] + high[axis]) / 2


@compiled
def _project(T: Array, surface: Array, K: Array, places: Array, pixels: Array) -> bool:
    """Write where a surface (n, 3) placed by T (4, 4) lies in the camera frame into `places`
    (3, n), and in the image into `pixels` (2, n); whether all of it is before the camera."""
    nearest = np.inf
    for n in range(len(surface)):
        p, q, r = surface[n, 0], surface[n, 1], surface[n, 2]
        x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
        y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
        z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3]
        places[0, n], places[1, n], places[2, n] = x, y, z
        nearest = min(nearest, z)
        away = 1 / max(z, NEAREST)
        pixels[0, n] = x * away * K[0, 0] + K[0, 2]
        pixels[1, n] = y * away * K[1, 1] + K[1, 2]
    return nearest > NEAREST


@compiled
def _close(
    T: Array, places: Array, gap: Array, directions: Array, T_cam_plane: Array, K: Array
) -> None:
    """Move a placement (4, 4), in place, along the plane: by what moves the middle of its places
    (3, n) in the image by the motion that closes most of the gaps (d,)."""
    across = down = 0.0
    for d in range(len(gap)):
        across += 2 * gap[d] * directions[d, 0] / len(gap)
        down += 2 * gap[d] * directions[d, 1] / len(gap)
    middle = np.zeros(3)
    for axis in range(3):
        middle[axis] = places[axis].mean()
    z = max(middle[2], NEAREST)
    R = T_cam_plane
    # Of pixels with the shift along x and y of the plane.
    a = (R[0, 0] - middle[0] / z * R[2, 0]) * K[0, 0] / z + 1e-9
    b = (R[0, 1] - middle[0] / z * R[2, 1]) * K[0, 0] / z
    c = (R[1, 0] - middle[1] / z * R[2, 0]) * K[1, 1] / z
    e = (R[1, 1] - middle[1] / z * R[2, 1]) * K[1, 1] / z + 1e-9
    determinant = a * e - b * c
    if determinant != 0:
        T[0, 3] += (e * across - b * down) / determinant
        T[1, 3] += (a * down - c * across) / determinant
