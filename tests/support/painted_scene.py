"""Painted solids on a table, as meshes for a prior and as a frame of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject, transform_points
from brrp_cli.raycast import look

H, W, FOCAL = 240, 320, 300.0
K = np.array([[FOCAL, 0, W / 2], [0, FOCAL, H / 2], [0, 0, 1]])
TABLE = (140, 130, 120)


def box(*sides):
    return trimesh.creation.box(sides).apply_translation([0, 0, sides[2] / 2])


def can(radius, height):
    return trimesh.creation.cylinder(radius, height, sections=32).apply_translation(
        [0, 0, height / 2]
    )


# Two of one shape, two of one colour.
THINGS = {
    "red_box": (box(0.10, 0.06, 0.12), (190, 40, 35)),
    "blue_box": (box(0.10, 0.06, 0.12), (40, 60, 170)),
    "red_can": (can(0.035, 0.10), (190, 40, 35)),
    "yellow_ball": (
        trimesh.creation.icosphere(3, 0.05).apply_translation([0, 0, 0.05]),
        (220, 190, 50),
    ),
    "green_plate": (can(0.10, 0.02), (60, 150, 70)),
}
# Not for a prior.
STRANGE = (box(0.03, 0.03, 0.22), (150, 50, 160))


def write_things(folder: Path) -> Path:
    """NAME.ply of each of `THINGS`, painted in one colour."""
    folder.mkdir(parents=True)
    for name, (mesh, color) in THINGS.items():
        painted = mesh.copy()
        painted.visual.vertex_colors = np.tile(color, (len(mesh.vertices), 1))
        painted.export(folder / f"{name}.ply")
    return folder


def photograph(things, light=(1.0, 1.0, 1.0)) -> Frame:
    """A frame of {id: (mesh, colour, x, y)} on a table, shaded, in light of that colour."""
    T_world_cam = camera_pose(np.array([0.0, 0.0, 0.03]), 0.8, 0.6, 0.4)
    table = trimesh.creation.box((1.2, 1.2, 0.02)).apply_translation([0, 0, -0.01])
    meshes = [table] + [m.copy().apply_translation([x, y, 0]) for m, _, x, y in things.values()]
    for mesh in meshes:
        mesh.vertices = transform_points(np.linalg.inv(T_world_cam), mesh.vertices)
    sight = look(meshes, K, (H, W))
    paint = np.array([(90, 90, 90), TABLE, *(color for _, color, _, _ in things.values())])
    shade = 0.65 + 0.35 * np.abs(sight.normals[..., 2])
    rgb = paint[sight.index + 1] * shade[..., None] * np.array(light)
    ids = np.array([0, 0, *things])[sight.index + 1]
    return Frame(
        rgb=np.clip(rgb, 0, 255).astype(np.uint8),
        points=backproject(sight.depth, K),
        segmap=ids.astype(np.int64),
        K=K,
        T_world_cam=T_world_cam,
    )
