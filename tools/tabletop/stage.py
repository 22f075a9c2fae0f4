"""What stands in front of a camera, with what it does to infrared light, to be cast rays at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_open3d
from brrp_cli.depth_noise.view import View
from brrp_cli.raycast import raycasting_scene
from tabletop.camera import Camera
from tabletop.furniture import Furniture
from tabletop.models import Model
from tabletop.settle import TABLE, Panel, Pose, rotation

# From OpenGL's camera (x right, y up, looking along -z) to ours (y down, looking along z).
_FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Surface:
    """A mesh in the colour camera's frame, metres, and its answer to infrared light.

    vertices (n, 3), faces (m, 3), uv (n, 2) or None; albedo : the diffuse share of the light that
    falls on it, a number or an image (h, w) that `uv` points into; gloss : 0 matt to 1 mirror-like
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None
    albedo: NDArray[np.float64]
    gloss: float


@dataclass(frozen=True)
class Hits:
    """What rays meet, arrays of the rays' shape.

    depth : metres along z, 0 = nothing; points, normals : (..., 3), colour camera's frame;
    albedo, gloss : of the surface there, 0 where nothing is
    """

    depth: NDArray[np.float32]
    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    albedo: NDArray[np.float32]
    gloss: NDArray[np.float32]


@dataclass(frozen=True)
class Stage:
    """Surfaces in the colour camera's frame; that camera's K (3, 3) and image shape (H, W)."""

    surfaces: tuple[Surface, ...]
    K: NDArray[np.float64]
    shape: tuple[int, int]

    @cached_property
    def _scene(self) -> Any:
        return raycasting_scene(self.surfaces)  # type: ignore[arg-type]

    def cast(self, origin: NDArray[np.float64], directions: NDArray[np.float64]) -> Hits:
        """Rays from `origin` (3,) along directions (..., 3) with z = 1."""
        o3d = import_open3d()
        rays = np.empty((*directions.shape[:-1], 6), dtype=np.float32)
        rays[..., :3] = origin
        rays[..., 3:] = directions
        answer = self._scene.cast_rays(o3d.core.Tensor(rays))
        depth = answer["t_hit"].numpy()
        hit = np.isfinite(depth)
        depth[~hit] = 0.0
        albedo = np.zeros(depth.shape, dtype=np.float32)
        gloss = np.zeros(depth.shape, dtype=np.float32)
        index = np.where(hit, answer["geometry_ids"].numpy().astype(np.int64), -1)
        triangle, bary = answer["primitive_ids"].numpy(), answer["primitive_uvs"].numpy()
        for number, surface in enumerate(self.surfaces):
            here = index == number
            if here.any():
                albedo[here] = _albedo(surface, triangle[here].astype(np.int64), bary[here])
                gloss[here] = surface.gloss
        points = origin.astype(np.float32) + depth[..., None] * rays[..., 3:]
        return Hits(depth, points, answer["primitive_normals"].numpy(), albedo, gloss)

    def lit(self, points: NDArray[np.floating], source: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of points (..., 3) see the light at `source` (3,)."""
        o3d = import_open3d()
        rays = np.empty((*points.shape[:-1], 6), dtype=np.float32)
        rays[..., :3] = source
        rays[..., 3:] = points - source
        hits = self._scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
        return np.asarray(hits > 1 - 2e-3)

    def view(self, offset: float) -> View:
        """What a camera with the same K sees from `offset` metres to the right."""
        hits = self.cast(np.array([offset, 0.0, 0.0]), pixel_rays(self.K, self.shape))
        return View(hits.depth.astype(np.float64), self.K, hits.normals, hits.albedo, hits.gloss)


def pixel_rays(
    K: NDArray[np.float64], shape: tuple[int, int], samples: int = 1
) -> NDArray[np.float64]:
    """Directions (H samples, W samples, 3) with z = 1 through samples x samples points a pixel."""
    height, width = shape
    fraction = (np.arange(samples) + 0.5) / samples - 0.5
    u = (np.arange(width)[:, None] + fraction).ravel()
    v = (np.arange(height)[:, None] + fraction).ravel()
    x, y = np.meshgrid((u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1])
    return np.stack([x, y, np.ones(x.shape)], axis=-1)


def _albedo(
    surface: Surface, triangle: NDArray[np.int64], bary: NDArray[np.float32]
) -> NDArray[np.float64]:
    if surface.uv is None or surface.albedo.ndim == 0:
        return np.broadcast_to(surface.albedo.mean(), triangle.shape)
    a, b, c = surface.uv[surface.faces[triangle]].transpose(1, 0, 2)
    s, t = bary[:, :1], bary[:, 1:]
    uv = a * (1 - s - t) + b * s + c * t
    height, width = surface.albedo.shape
    column = np.floor((uv[:, 0] % 1.0) * width).astype(np.int64).clip(0, width - 1)
    row = np.floor(((1 - uv[:, 1]) % 1.0) * height).astype(np.int64).clip(0, height - 1)
    return surface.albedo[row, column]


def stage_of(
    models: Sequence[Model],
    poses: Sequence[Pose],
    colors: NDArray[np.float64],
    camera: Camera,
    K: NDArray[np.float64],
    shape: tuple[int, int],
    rng: np.random.Generator,
    furniture: Furniture | None = None,
    dark_table: bool = False,
) -> Stage:
    """The stage of a tabletop scene; `rng` draws what the materials do to infrared light.

    dark_table : whether the table, or the floor, hardly sends any of it back"""
    R = _FLIP @ camera.view[:3, :3]
    t = _FLIP @ camera.view[:3, 3]
    surfaces = [
        Surface(pose.apply(model.vertices) @ R.T + t, model.faces, model.uv, *_material(grey, rng))
        for model, pose, grey in (
            (model, pose, _print(model, color))
            for model, pose, color in zip(models, poses, colors, strict=True)
        )
    ]
    ground = TABLE if furniture is None else furniture.ground
    usual = _furniture(rng)
    surfaces.append(_panel(ground, *(_dark(rng) if dark_table else usual), R, t))
    if furniture is not None:
        material = _furniture(rng)
        surfaces += [_panel(panel, *material, R, t) for panel in furniture.panels()]
    return Stage(tuple(surfaces), K, shape)


def _print(model: Model, color: NDArray[np.float64]) -> NDArray[np.float64]:
    # Near infrared resembles red far more than blue.
    weights = np.array([0.7, 0.2, 0.1])
    if model.texture is None:
        return np.asarray(color @ weights)
    return np.asarray(np.asarray(model.texture, dtype=np.float64) / 255 @ weights)


# Shares of objects whose material is black in infrared (carbon-filled plastic, rubber), and glossy.
DARK, GLOSSY = 0.15, 0.3


def _material(
    grey: NDArray[np.float64], rng: np.random.Generator
) -> tuple[NDArray[np.float64], float]:
    """Albedo and gloss of one object whose print is `grey`, 0 to 1.

    Most inks are thin in infrared, so that a print shows in part only.
    """
    dark, glossy = rng.random(2) < (DARK, GLOSSY)
    base = rng.uniform(0.04, 0.12) if dark else rng.uniform(0.5, 0.9)
    ink = rng.uniform(0.0, 0.3) if dark else rng.uniform(0.3, 0.9)
    gloss = rng.uniform(0.4, 0.9) if glossy else rng.uniform(0.0, 0.2)
    return base * (1 - ink * (1 - grey)), float(gloss)


def _furniture(rng: np.random.Generator) -> tuple[NDArray[np.float64], float]:
    albedo, gloss = rng.uniform(0.3, 0.8), rng.uniform(0.0, 0.3)
    return np.asarray(albedo), float(gloss)


def _dark(rng: np.random.Generator) -> tuple[NDArray[np.float64], float]:
    albedo, gloss = rng.uniform(0.03, 0.1), rng.uniform(0.3, 0.8)
    return np.asarray(albedo), float(gloss)


def _panel(
    panel: Panel,
    albedo: NDArray[np.float64],
    gloss: float,
    R: NDArray[np.float64],
    t: NDArray[np.float64],
) -> Surface:
    import trimesh

    box = trimesh.creation.box(2 * panel.half)
    vertices = np.asarray(box.vertices) @ rotation(panel.orientation).T + panel.position
    return Surface(vertices @ R.T + t, np.asarray(box.faces, dtype=np.int64), None, albedo, gloss)
