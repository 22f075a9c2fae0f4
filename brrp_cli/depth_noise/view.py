"""What a depth camera looks at, pixel by pixel, before it measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class View:
    """The depth camera's own view, free of errors.

    depth : (H, W) float64, metres along z, 0 = nothing there
    K : (3, 3) pinhole intrinsics, pixels
    normals : (H, W, 3) float, unit, either sign, camera frame
    albedo : (H, W) float, 0 to 1, the diffuse share of the infrared light that falls on a surface
    gloss : (H, W) float, 0 = matt to 1 = mirror-like
    """

    depth: NDArray[np.float64]
    K: NDArray[np.float64]
    normals: NDArray[np.floating]
    albedo: NDArray[np.floating]
    gloss: NDArray[np.floating]

    @cached_property
    def rays(self) -> NDArray[np.float64]:
        """(H, W, 3) direction of each pixel's ray with z = 1."""
        v, u = np.indices(self.depth.shape, dtype=np.float64)
        x, y = (u - self.K[0, 2]) / self.K[0, 0], (v - self.K[1, 2]) / self.K[1, 1]
        return np.stack([x, y, np.ones(x.shape)], axis=-1)

    @cached_property
    def stretch(self) -> NDArray[np.float64]:
        """(H, W) length of `rays`: distance from the camera over depth."""
        return np.asarray(np.linalg.norm(self.rays, axis=-1))

    @cached_property
    def cosine(self) -> NDArray[np.float64]:
        """(H, W) cosine of the angle between the surface's normal and the ray."""
        return np.asarray(np.abs(np.sum(self.normals * self.rays, axis=-1)) / self.stretch)

    @cached_property
    def signal(self) -> NDArray[np.float64]:
        """(H, W) light that comes back to a camera with its own lamp: 1 for a white matt surface
        that faces it at 1 m, falling with the square of the distance; 0 where nothing is.
        """
        seen = self.depth > 0
        distance = np.where(seen, self.depth * self.stretch, 1.0)
        diffuse = self.albedo * (1 - self.gloss) * self.cosine
        return np.asarray(np.where(seen, diffuse / distance**2, 0.0))

    @cached_property
    def highlight(self) -> NDArray[np.float64]:
        """(H, W) share of the lamp's light that a glossy surface mirrors straight back."""
        return np.asarray(np.where(self.depth > 0, self.gloss * self.cosine**_SHININESS, 0.0))


_SHININESS = 60  # exponent of a highlight seen from the lamp (Blinn-Phong)
