"""Placements of a stored object that its mask alone suggests.

Of what is dark, shiny or clear, depth shows little or nothing. The mask is still there: the object
rests on the plane, and is seen where the mask is. The outlines of both are compared by their
support functions: how far they reach in each direction of the image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.registration import MaskPosesConfig
from brrp_cli.frames.frame import Frame
from brrp_cli.observation.support_plane import Plane, plane_frame
from brrp_cli.registration.initial_poses import turns
from brrp_cli.registration.model import ModelGeometry

Array = NDArray[np.float64]

# Metres; what is nearer to the camera is not seen.
NEAREST = 0.01


@dataclass(frozen=True)
class MaskOutline:
    """How far a mask reaches in the image, without what stands behind it.

    reach : (d,) pixels along `directions` (d, 2), evenly spread; K : (3, 3); T_cam_plane : (4, 4)
    """

    reach: Array
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
    angle = np.arange(config.directions) * (2 * np.pi / config.directions)
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rows, columns = np.nonzero(frame.segmap == object_id)
    pixels = np.stack([columns, rows], axis=1).astype(np.float64)
    return MaskOutline(
        reach=(pixels @ directions.T).max(axis=0),
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
    for sign in (-1, 1):
        c, s = np.cos(angle), sign * np.sin(angle)
        R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        T = T_plane_model.copy()
        T[:, :3, :3] = R @ T[:, :3, :3]
        found.append(T)
    return np.concatenate(found)


def _shifted(
    T_plane_model: Array, surface: Array, seen: MaskOutline, config: MaskPosesConfig
) -> tuple[Array, Array]:
    """Placements (b, 4, 4) shifted along the plane towards the mask in some steps, and by how much
    their outlines then differ from it (b,), as a share of its size; inf for what is then behind
    the camera."""
    R, t = seen.T_cam_plane[:3, :3], seen.T_cam_plane[:3, 3]
    T = T_plane_model.copy()
    points = np.einsum("bij,nj->bni", T[:, :3, :3], surface)
    points[..., 2] += T[:, None, 2, 3]
    T[:, :2, 3] = _below(seen, points[..., 2].max(axis=1) / 2)
    T[:, :2, 3] -= (points[..., :2].min(axis=1) + points[..., :2].max(axis=1)) / 2
    relative = points @ R.T + t
    for step in range(config.steps + 1):
        here = relative + (T[:, :2, 3] @ R[:, :2].T)[:, None]
        z = np.maximum(here[..., 2], NEAREST)
        u = here[..., 0] / z * seen.K[0, 0] + seen.K[0, 2]
        v = here[..., 1] / z * seen.K[1, 1] + seen.K[1, 2]
        reach = (np.stack([u, v], axis=-1) @ seen.directions.T).max(axis=1)
        gap = seen.reach - reach
        if step == config.steps:
            break
        # The motion of the image that closes most of the gaps, and that along the plane for it.
        moved = 2 * gap @ seen.directions / len(seen.directions)
        middle = here.mean(axis=1)
        T[:, :2, 3] += _along_plane(moved, middle, R, seen.K)
    off = np.abs(gap).mean(axis=1) / max(seen.size, 1.0)
    off[(here[..., 2] <= NEAREST).any(axis=1)] = np.inf
    return T, off


def _below(seen: MaskOutline, heights: Array) -> Array:
    """Where the ray through the mask's middle meets the heights (b,), metres above the plane,
    (b, 2)."""
    u, v = seen.middle
    K, R = seen.K, seen.T_cam_plane[:3, :3]
    ray = R.T @ np.array([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], 1.0])
    eye = -R.T @ seen.T_cam_plane[:3, 3]
    # A ray that does not come down meets nothing: what it would show stands far away.
    down = min(ray[2], -1e-3)
    way = (heights - eye[2]) / down
    return np.asarray(eye[:2] + way[:, None] * ray[:2])


def _along_plane(moved: Array, at: Array, R: Array, K: Array) -> Array:
    """Shifts (b, 2) along the plane, metres, that move points (b, 3) by `moved` (b, 2) pixels."""
    z = np.maximum(at[:, 2], NEAREST)[:, None]
    du = (R[None, 0, :2] - at[:, 0, None] / z * R[None, 2, :2]) * K[0, 0] / z
    dv = (R[None, 1, :2] - at[:, 1, None] / z * R[None, 2, :2]) * K[1, 1] / z
    J = np.stack([du, dv], axis=1)
    J += 1e-9 * np.eye(2)
    return np.asarray(np.linalg.solve(J, moved[..., None])[..., 0])
