"""Placements of a stored object that its mask alone suggests.

Of what is dark, shiny or clear, depth shows little or nothing. The mask is still there: the object
rests on the plane, and is seen where the mask is. The outlines of both are compared by their
support functions: how far they reach in each direction of the image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.seen_mask import MaskPosesConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import turn_about_z
from brrp_cli.observation.support_plane import Plane, plane_frame
from brrp_cli.registration.initial_poses import turns
from brrp_cli.registration.mask_edges import around, reach_of
from brrp_cli.registration.mask_loops import shifted
from brrp_cli.registration.model import ModelGeometry

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MaskOutline:
    """How far a mask reaches in the image.

    reach : (d,) pixels along `directions` (d, 2), evenly spread; cut : (d,) 1 where it may go on, 0
    where it ends; K : (3, 3); T_cam_plane : (4, 4)
    """

    reach: Array
    cut: Array
    directions: Array
    K: Array
    T_cam_plane: Array

    @property
    def middle(self) -> Array:
        """(2,) pixels: the middle of a circle that reaches as far, as nearly as can be."""
        return 2 * self.reach @ self.directions / len(self.reach)

    @property
    def size(self) -> float:
        """Pixels, from side to side, on average."""
        return float(2 * self.reach.mean())


def mask_outline(
    frame: Frame, object_id: int, plane: Plane, config: MaskPosesConfig
) -> MaskOutline:
    """The outline of an object of the frame."""
    directions = around(config.directions)
    reach, cut = reach_of(frame, object_id, directions, config.edge_width)
    return MaskOutline(
        reach=reach,
        cut=cut.astype(np.float64),
        directions=directions,
        K=frame.K.astype(np.float64),
        T_cam_plane=np.linalg.inv(np.asarray(plane_frame(plane), dtype=np.float64)),
    )


def poses_from_mask(model: ModelGeometry, seen: MaskOutline, config: MaskPosesConfig) -> Array:
    """T_cam_model (b, 4, 4): the model in its resting poses, turned about the plane's normal and
    shifted along it until its outline is that of the mask, the `kept` best, best first."""
    if not model.resting:
        return np.zeros((0, 4, 4))
    resting = np.stack(model.resting)
    T = (turns(config.turns) @ resting[:, None]).reshape(-1, 4, 4)
    surface = model.surface[: config.points]
    T, off = _shifted(T, surface, seen, config)
    first = np.argsort(off, kind="stable")[: config.kept]
    T, off = T[first], off[first]
    angle = np.pi / config.turns
    for _ in range(config.halved):
        angle /= 2
        T, off = _shifted(_turned_both_ways(T, angle), surface, seen, config)
        # Of each the best turn, so that what looks alike from other sides stays.
        count = len(T) // 3
        each = off.reshape(3, count).argmin(axis=0) * count + np.arange(count)
        T, off = T[each], off[each]
    return np.asarray(seen.T_cam_plane @ T[np.argsort(off, kind="stable")])


def _turned_both_ways(T_plane_model: Array, angle: float) -> Array:
    """Each of (b, 4, 4), and it turned by `angle` either way about where it stands, (3b, 4, 4)."""
    found = [T_plane_model]
    for turned in (-angle, angle):
        T = T_plane_model.copy()
        T[:, :3, :3] = turn_about_z(turned) @ T[:, :3, :3]
        found.append(T)
    return np.concatenate(found)


def _shifted(
    T_plane_model: Array, surface: Array, seen: MaskOutline, config: MaskPosesConfig
) -> tuple[Array, Array]:
    """Placements (b, 4, 4) shifted along the plane towards the mask in some steps, and by how much
    their outlines then differ from it (b,), as a share of its size; inf for what is then behind
    the camera."""
    K, R = seen.K, seen.T_cam_plane[:3, :3]
    u, v = seen.middle
    ray = R.T @ np.array([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], 1.0])
    # A ray that does not come down meets nothing: what it would show stands far away.
    ray[2] = min(ray[2], -1e-3)
    eye = -R.T @ seen.T_cam_plane[:3, 3]
    T, off = shifted(
        T_plane_model,
        surface,
        seen.T_cam_plane,
        K,
        eye,
        ray,
        seen.reach,
        seen.cut,
        seen.directions,
        config.steps,
    )
    return T, off / max(seen.size, 1.0)
