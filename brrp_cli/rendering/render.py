"""Pictures of meshes by ray casting: no window, no graphics driver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.geometry import normalise, project, transform_points
from brrp_cli.raycast import surface_scene
from brrp_cli.reconstruction import Surface

BACKGROUND = np.array([245, 245, 245], dtype=np.uint8)
AMBIENT = 0.35


@dataclass(frozen=True)
class PinholeView:
    """A pinhole camera: K (3, 3) in pixels, T_view_cam (4, 4), size (H, W) in pixels."""

    K: NDArray[np.float64]
    T_view_cam: NDArray[np.float64]
    shape: tuple[int, int]


def view_from_behind(
    view: PinholeView, target: NDArray[np.floating], up: NDArray[np.floating]
) -> PinholeView:
    """The view turned half way round `target` (3,) about `up` (3,), both in the camera frame."""
    axis = normalise(np.asarray(up, dtype=np.float64))
    half_turn = 2 * np.outer(axis, axis) - np.eye(3)
    T = np.eye(4)
    T[:3, :3] = half_turn
    T[:3, 3] = target - half_turn @ target
    return PinholeView(view.K, view.T_view_cam @ T, view.shape)


def fitted(view: PinholeView, surfaces: list[Surface], margin: float = 0.05) -> PinholeView:
    """The view with its lens changed so that all surfaces fill the picture but for a margin."""
    if not surfaces:
        return view
    vertices = np.concatenate([s.vertices for s in surfaces])
    seen = transform_points(view.T_view_cam, vertices)
    pixels = project(seen[seen[:, 2] > 0], view.K)
    size = np.array([view.shape[1], view.shape[0]])
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    zoom = float(((1 - 2 * margin) * size / (high - low)).min())
    K = view.K.copy()
    K[:2] *= zoom
    K[:2, 2] += size / 2 - zoom * (low + high) / 2
    return PinholeView(K, view.T_view_cam, view.shape)


def render(
    surfaces: list[Surface], colours: list[NDArray[np.uint8]], view: PinholeView
) -> NDArray[np.uint8]:
    """(H, W, 3) picture of surfaces with a colour for each vertex (n, 4), lit from the camera."""
    o3d = import_open3d()
    height, width = view.shape
    image = np.tile(BACKGROUND, (height, width, 1))
    if not surfaces:
        return image
    vertices = np.concatenate([s.vertices for s in surfaces])
    offsets = np.cumsum([0, *(len(s.vertices) for s in surfaces[:-1])])
    faces = np.concatenate([s.faces + o for s, o in zip(surfaces, offsets, strict=True)])
    palette = np.concatenate(colours)[:, :3].astype(np.float64)
    scene = surface_scene(transform_points(view.T_view_cam, vertices), faces, threads=0)
    rays = scene.create_rays_pinhole(
        o3d.core.Tensor(view.K), o3d.core.Tensor(np.eye(4)), width, height
    )
    hits = scene.cast_rays(rays)
    hit = np.isfinite(hits["t_hit"].numpy())
    corner = faces[hits["primitive_ids"].numpy()[hit]]
    u, v = hits["primitive_uvs"].numpy()[hit].T
    weights = np.stack([1 - u - v, u, v], axis=1)
    colour = np.einsum("nc,ncd->nd", weights, palette[corner])
    directions = normalise(rays.numpy()[hit][:, 3:])
    facing = np.abs(np.einsum("nd,nd->n", directions, hits["primitive_normals"].numpy()[hit]))
    image[hit] = colour * (AMBIENT + (1 - AMBIENT) * facing)[:, None]
    return image
