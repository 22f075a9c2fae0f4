"""Colour, depth buffer and object ids of a view, by PyBullet's software renderer.

Its row v shows normalised y = 1 - 2 (v + 1) / H of the projection it is given (measured: with that
row the table's top lies within a micrometre of z = 0, with row v 1 mm off), whereas the published
layout reads row v as 1 - 2v / H. It is therefore given a projection that is shifted up by one row;
the one that is written to camera.npz fits the layout.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tabletop.camera import Camera
from tabletop.furniture import Furniture
from tabletop.models import Model
from tabletop.settle import TABLE, Panel, Pose
from tabletop.world import World, new_world

NOTHING = 1.0  # depth buffer where there is no return: the far plane


@dataclass(frozen=True)
class Look:
    """What a scene looks like: colours 0 to 1, and the direction towards the light."""

    object_colors: NDArray[np.float64]
    table_color: NDArray[np.float64]
    light: NDArray[np.float64]


@dataclass(frozen=True)
class Picture:
    """rgb (H, W, 3) uint8, depth buffer (H, W) float32, ids (H, W) int32 with 0 = background."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int32]


def draw_look(count: int, rng: np.random.Generator) -> Look:
    """Random colours for `count` objects (used where a mesh has no colours), table and light."""
    import colorsys

    colors = [
        colorsys.hsv_to_rgb(h, 0.4 + 0.6 * s, 0.4 + 0.6 * v) for h, s, v in rng.random((count, 3))
    ]
    table = colorsys.hsv_to_rgb(rng.uniform(0.03, 0.12), rng.uniform(0, 0.4), rng.uniform(0.5, 0.9))
    light = np.array([*rng.uniform(-1, 1, 2), rng.uniform(1.5, 2.5)])
    return Look(np.array(colors), np.array(table), light)


def render(
    models: Sequence[Model],
    poses: Sequence[Pose],
    look: Look,
    cameras: Sequence[Camera],
    size: tuple[int, int],
    furniture: Furniture | None = None,
) -> list[Picture]:
    """A picture from each camera, `size` = (width, height). Object number i has the id i + 1;
    table and furniture are background."""
    with new_world() as world, tempfile.TemporaryDirectory() as textures:
        ids = {
            _add_object(world, model, pose, color, Path(textures) / f"{i}.bmp"): i + 1
            for i, (model, pose, color) in enumerate(
                zip(models, poses, look.object_colors, strict=True)
            )
        }
        _show(world, furniture.ground if furniture else TABLE, look.table_color)
        for panel in furniture.panels() if furniture else ():
            _show(world, panel, np.array(furniture.color))
        return [_take(world, camera, look, ids, size) for camera in cameras]


def _show(world: World, panel: Panel, color: NDArray[np.float64]) -> None:
    shape = world.createVisualShape(
        world.GEOM_BOX, halfExtents=panel.half.tolist(), rgbaColor=[*color, 1]
    )
    world.createMultiBody(
        0,
        -1,
        shape,
        basePosition=panel.position.tolist(),
        baseOrientation=panel.orientation.tolist(),
    )


def _add_object(
    world: World, model: Model, pose: Pose, color: NDArray[np.float64], texture_file: Path
) -> int:
    textured = model.uv is not None
    shape = world.createVisualShape(
        world.GEOM_MESH,
        vertices=model.vertices.tolist(),
        indices=model.faces.ravel().tolist(),
        normals=model.normals.tolist(),
        rgbaColor=[1, 1, 1, 1] if textured else [*color, 1],
        **({"uvs": model.uv.tolist()} if model.uv is not None else {}),
    )
    body = world.createMultiBody(
        0,
        -1,
        shape,
        basePosition=pose.position.tolist(),
        baseOrientation=pose.orientation.tolist(),
    )
    if textured:
        model.texture.save(texture_file)
        texture = world.loadTexture(str(texture_file))
        world.changeVisualShape(body, -1, textureUniqueId=texture)
    return int(body)


def _take(
    world: World, camera: Camera, look: Look, ids: dict[int, int], size: tuple[int, int]
) -> Picture:
    width, height = size
    shifted = camera.projection.copy()
    shifted[1] -= 2 / height * shifted[3]
    _, _, rgba, depth, bodies = world.getCameraImage(
        width,
        height,
        camera.view.T.ravel().tolist(),
        shifted.T.ravel().tolist(),
        lightDirection=look.light.tolist(),
        lightAmbientCoeff=0.55,
        lightDiffuseCoeff=0.5,
        lightSpecularCoeff=0.05,
        shadow=0,
        renderer=world.ER_TINY_RENDERER,
    )
    rgb = np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4)[..., :3]
    bodies = np.asarray(bodies, dtype=np.int32).reshape(height, width)
    depth = np.asarray(depth, dtype=np.float32).reshape(height, width)
    segmap = np.zeros((height, width), dtype=np.int32)
    for body, object_id in ids.items():
        segmap[bodies == body] = object_id
    return Picture(rgb, np.where(bodies < 0, np.float32(NOTHING), depth), segmap)
