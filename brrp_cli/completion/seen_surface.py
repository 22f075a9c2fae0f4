"""What the depth of an object says of its surface: bounds of the completion's logit.

What was seen is a surface, to within the noise: the logit is 0 there, and a ramp about it, by the
distance across the surface: where that slants, a way along the camera's sight is longer. Behind
it the ramp is the least that the logit may be, for as thick as the thinnest wall; so a wall is
there however thin the network makes it. In front of it the ramp is what the logit is, where the
depth is the object's own beyond doubt. Elsewhere it says nothing: sensors mix both sides of a jump
of depth, and flatten what lies on a table. There the surface is taken to be a little nearer than it
was measured. (Were the ramp also the most that the logit may be behind it, the surface would lie a
tenth to a quarter of a millimetre further back: that gains next to nothing under structured light,
and an Azure Kinect measures too far as it is.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import MeanConfig, RampConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import at_pixels, between_pixels, depth_behind
from brrp_cli.observation.fitted_depth import smoothed
from brrp_cli.observation.pixel_noise import PixelNoise
from brrp_cli.observation.slant import across_surface
from brrp_cli.observation.support_plane import Plane

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bounds:
    """Logits (n,), the least and the most that they may be."""

    least: Array
    most: Array

    def applied(self, logits: NDArray[np.floating]) -> Array:
        """Logits (n,) within the bounds; between them where they contradict each other."""
        middle = (self.least + self.most) / 2
        against = self.least > self.most
        low, high = (np.where(against, middle, each) for each in (self.least, self.most))
        return np.asarray(np.clip(logits, low, high))


@dataclass(frozen=True)
class SeenSurface:
    """frame : with the object's depth smoothed; sure : (H, W) bool, the object's pixels whose
    depth is its own surface beyond doubt; nearer : metres, by which the surface lies in front of
    the other pixels' depth; across : (H, W), metres across the surface for a metre along the
    camera's axis; plane : on which the object stands"""

    frame: Frame
    object_id: int
    sure: NDArray[np.bool_]
    nearer: float
    across: NDArray[np.float32]
    plane: Plane | None = None

    def bounds(self, points: Array, shell: float, config: MeanConfig) -> Bounds:
        """At points (n, 3), metres, camera frame; shell : metres, how thick what was seen is."""
        behind = self.behind(points)
        own = at_pixels(points, self.frame.segmap, self.frame) == self.object_id
        own &= np.isfinite(behind)
        sure = at_pixels(points, self.sure, self.frame) == 1
        behind += np.where(sure, 0.0, self.nearer)
        behind *= np.where(own, at_pixels(points, self.across, self.frame), 1.0)
        found = ramp_bounds(behind, own, own & sure, shell, config)
        if self.plane is None:
            return found
        # What stands on the plane ends there, however thick what was seen may be.
        sunk = self.plane.signed_distance(points) < -config.sunk
        return Bounds(np.where(sunk, -config.limit, found.least), found.most)

    def behind(self, points: Array) -> Array:
        """Metres (n,) from what was seen to points (n, 3), along the camera's axis; NaN where there
        is no depth. Between sure pixels the surface is a plane: whole pixels would make stairs of
        what leans."""
        with np.errstate(divide="ignore"):
            inverse = np.where(self.sure, 1 / self.frame.depth, np.nan)
        between = points[:, 2] - 1 / between_pixels(points, inverse, self.frame)
        return np.where(np.isfinite(between), between, -depth_behind(points, self.frame))


def seen_surface(
    frame: Frame, object_id: int, plane: Plane | None, noise: PixelNoise, config: RampConfig
) -> SeenSurface:
    """Of an object in a frame as it was measured."""
    from scipy.ndimage import binary_erosion

    own = frame.segmap == object_id
    margin = max(1, round(config.margin * frame.K[0, 0]))
    sure = np.asarray(binary_erosion(own, iterations=margin)) & ~noise.at_jump
    smooth = smoothed(frame, object_id, noise, config.depth)
    seen = smooth.depth[own & frame.valid]
    wave = noise.wave_at(float(np.median(seen))) if len(seen) else 0.0
    if plane is not None:
        with np.errstate(invalid="ignore"):
            sure &= plane.signed_distance(smooth.points) > config.rise * wave
    across = across_surface(smooth, object_id, config.slant)
    return SeenSurface(smooth, object_id, sure, config.nearer * wave, across, plane)


def ramp_bounds(
    behind: Array,
    own: NDArray[np.bool_],
    sure: NDArray[np.bool_],
    shell: float,
    config: MeanConfig,
) -> Bounds:
    """Of points that lie `behind` (n,) metres behind what was seen, across it, where it is the
    object's `own` (n,); in front of it only where that is `sure` (n,). shell : as in
    `SeenSurface.bounds`."""
    ramp = config.shell_logit / config.ramp.width * np.clip(behind, -shell, shell)
    front = sure & (behind < 0)
    told = own & (behind < shell) & np.where(front, behind > -shell, behind >= 0)
    return Bounds(
        np.where(told, np.maximum(ramp, -config.limit), -config.limit),
        np.where(front, np.maximum(ramp, -config.limit), config.limit),
    )


def joined(bounds: Sequence[Bounds]) -> Bounds:
    """Of several views of one object."""
    return Bounds(
        np.max([each.least for each in bounds], axis=0),
        np.min([each.most for each in bounds], axis=0),
    )
