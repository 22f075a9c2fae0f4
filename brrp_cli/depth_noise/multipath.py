"""Light that reaches a time-of-flight camera after one bounce between the surfaces it sees.

Surfaces are taken as matt patches that light each other, as Jimenez, Pizarro, Mazo & Palazuelos
do ("Modeling and correction of multipath interference in time of flight cameras", Image and Vision
Computing 2014). Patches that the camera does not see light nothing, and nothing stands between two
patches.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.depth_noise.view import View

PATCH = 12  # pixels: side of a patch
_ROWS = 512  # patches handled at a time


def bounced_light(view: View, half_wave: float) -> NDArray[np.complex128]:
    """Phasors (H, W) of the light that came by way of another surface, in units of `View.signal`.

    half_wave : metres of distance for one turn of the phase
    """
    height, width = view.depth.shape
    rows = np.arange(PATCH // 2, height, PATCH)
    columns = np.arange(PATCH // 2, width, PATCH)
    grid = np.ix_(rows, columns)
    seen = (view.depth[grid] > 0).ravel()
    points = (view.rays[grid] * view.depth[grid][..., None]).reshape(-1, 3)[seen]
    if len(points) < 2:
        return np.zeros((height, width), dtype=np.complex128)
    normals = np.asarray(view.normals[grid], dtype=np.float64).reshape(-1, 3)[seen]
    normals *= -np.sign(np.sum(normals * points, axis=1))[:, None]
    distance = np.linalg.norm(points, axis=1)
    cosine = np.abs(np.sum(normals * points, axis=1)) / distance
    matt = (view.albedo * (1 - view.gloss))[grid].ravel()[seen]
    # Each patch covers as much surface as its pixels do at its depth and angle.
    focal = view.K[0, 0] * view.K[1, 1]
    area = PATCH**2 * points[:, 2] ** 2 / focal / np.maximum(cosine, 0.1)
    arrives = np.zeros(len(points), dtype=np.complex128)
    lamp = matt * cosine / distance**2 * area / np.pi
    for start in range(0, len(points), _ROWS):
        here = slice(start, start + _ROWS)
        between = points[None] - points[here, None]
        apart = np.linalg.norm(between, axis=-1)
        # Patches closer than their own size would light each other without bound.
        close = np.maximum(apart, np.sqrt(area)[None])
        leaves = np.clip(-np.einsum("ijk,jk->ij", between, normals), 0, None) / close
        meets = np.clip(np.einsum("ijk,ik->ij", between, normals[here]), 0, None) / close
        path = (distance[None] + apart + distance[here, None]) / 2
        given = lamp[None] * leaves * meets / close**2
        arrives[here] = np.sum(given * np.exp(2j * np.pi * path / half_wave), axis=1)
    # Less the turn of the patch itself, what arrives changes slowly and can be spread over pixels.
    turned = np.zeros(seen.shape, dtype=np.complex128)
    turned[seen] = arrives * np.exp(-2j * np.pi * distance / half_wave)
    spread = _spread(turned.reshape(len(rows), len(columns)), seen, (height, width))
    reflected = view.albedo * (1 - view.gloss) / np.maximum(view.depth * view.stretch, 0.1) ** 2
    own = np.exp(2j * np.pi * view.depth * view.stretch / half_wave)
    return np.asarray(np.where(view.depth > 0, spread * reflected * own, 0), dtype=np.complex128)


def _spread(
    values: NDArray[np.complex128], seen: NDArray[np.bool_], shape: tuple[int, int]
) -> NDArray[np.complex128]:
    """Patches to pixels, linearly, among the patches that were seen."""
    ndimage = import_library("scipy.ndimage")
    known = seen.reshape(values.shape).astype(np.float64)
    y = (np.arange(shape[0])[:, None] - PATCH // 2) / PATCH
    x = (np.arange(shape[1])[None, :] - PATCH // 2) / PATCH
    grid = np.broadcast_arrays(y, x)

    def sample(image: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(ndimage.map_coordinates(image, grid, order=1, mode="nearest"))

    weight = np.maximum(sample(known), 1e-6)
    return np.asarray((sample(values.real) + 1j * sample(values.imag)) / weight)
