"""What a whole frame says for and against many placements of a model at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config import VerificationConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.projection import depth_behind
from brrp_cli.geometry import bell
from brrp_cli.observation.support_plane import Plane
from brrp_cli.registration.model import ModelGeometry

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Verifier:
    """One seen object: its points (n, 3), metres, camera frame, in random order, the frame that
    shows it, and the plane it stands on, where there is one."""

    points: Array
    frame: Frame
    plane: Plane | None

    def score(
        self,
        T_cam_model: Array,
        model: ModelGeometry,
        config: VerificationConfig,
        *,
        model_points: int,
        seen_points: int,
    ) -> Array:
        """Evidence (B,) of placements T_cam_model (B, 4, 4), similarities; 1 at best.

        For: observed points on the model's surface. Against: observed points far from it, model
        surface in space that the camera saw to be free, model surface below the plane. Each is a
        share, so that seen and hidden sides, large and small objects are judged alike.
        """
        placed = _placed(T_cam_model, model.surface[:model_points])
        return (
            self._explained(T_cam_model, model, self.points[:seen_points], config)
            - config.contradiction * self._contradicted(placed, config)
            - config.contradiction * self._below(placed, config)
        )

    def _explained(
        self, T_cam_model: Array, model: ModelGeometry, seen: Array, config: VerificationConfig
    ) -> Array:
        """Mean (B,) of a Gaussian of the observed points' distances, less a share of how far the
        others are, so that a search that explains nothing yet still has a slope."""
        linear = T_cam_model[:, :3, :3]
        scale = np.cbrt(np.linalg.det(linear))
        T_model_cam = np.asarray(np.linalg.inv(T_cam_model), dtype=np.float64)
        in_model = _placed(T_model_cam, seen)
        distance = np.abs(model.distance(in_model.reshape(3, -1)))
        distance = distance.reshape(in_model.shape[1:]) * scale[:, None].astype(np.float32)
        near = bell(distance / config.near).mean(axis=1)
        far = (np.minimum(distance, config.far) / config.far).mean(axis=1)
        return np.asarray(near - config.distance * far)

    def _contradicted(self, points: Floats, config: VerificationConfig) -> Array:
        """Share (B,) of surfaces (3, B, m) that stands in front of the measured depth, soft in
        depth."""
        gap = depth_behind(points.reshape(3, -1).T, self.frame).reshape(points.shape[1:])
        # Where no depth is, nothing speaks against it.
        return np.asarray(np.fmax(_ramp(gap, config), 0).mean(axis=1))

    def _below(self, points: Floats, config: VerificationConfig) -> Array:
        if self.plane is None:
            return np.zeros(points.shape[1])
        height = np.tensordot(self.plane.normal, points, axes=1) + self.plane.offset
        return np.asarray(_ramp(-height, config).mean(axis=1))


def _ramp(depth: NDArray[np.floating], config: VerificationConfig) -> NDArray[np.floating]:
    return np.clip((depth - config.tolerance) / config.slope, 0, 1)


def _placed(T_target_source: Array, points: Array) -> Floats:
    """Points (n, 3) placed in B ways, (3, B, n): the axis comes first, since long contiguous rows
    are what NumPy is fast on; in single precision, which is right to a micrometre."""
    placed = T_target_source[:, :3, :3].swapaxes(0, 1) @ points.T
    placed += T_target_source[:, :3, 3].T[..., None]
    return np.asarray(placed, dtype=np.float32)
