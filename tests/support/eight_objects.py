"""Scenes of eight solids on a table, in files, and a network small enough to learn them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from table_scene import SHAPE, K, in_camera

from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.frames.npz import save_frame
from brrp_cli.geometry import similarity, turn_about_z
from brrp_cli.ground_truth.scenes import Scene, find_scenes
from brrp_cli.methods.pointsdf.network import NetworkConfig
from brrp_cli.raycast import look
from brrp_cli.shapes import kinds, solids

# Large: of a ball of 6 cm that is a millimetre too large, a tenth is wrong.
MESHES = {
    "ball": solids.ball(0.065),
    "block": solids.box(0.12, 0.12, 0.12),
    "bottle": kinds.bottle(0.055, 0.25, 0.025, 0.04, 0.06),
    "box": solids.box(0.18, 0.08, 0.15),
    "brick": solids.box(0.16, 0.10, 0.07),
    "can": solids.cylinder(0.06, 0.16),
    "tower": solids.box(0.08, 0.09, 0.22),
    "tub": solids.cylinder(0.09, 0.09),
}
YAWS = dict(zip(MESHES, np.linspace(0, 1.2, len(MESHES)), strict=True))
SPOTS = [(x, y) for y in (-0.18, 0.18) for x in (-0.45, -0.15, 0.15, 0.45)]
T_WORLD_CAM = camera_pose(np.array([0.0, 0.0, 0.05]), 1.1, 0.7, 0.1)

NETWORK = replace(
    NetworkConfig(),
    points=64,
    centres=(64, 32, 16, 8),
    neighbours=8,
    features=((16, 16), (16, 32), (32, 32), (32, 64)),
    code=32,
    query_code=32,
    hidden=64,
    dropout=0.0,
)


def photograph(things: list[trimesh.Trimesh]) -> Frame:
    """What the camera sees of meshes in its own frame, ids from 1, on a table."""
    table = solids.moved(solids.box(2.0, 2.0, 0.02), z=-0.02)
    sight = look([*things, in_camera(table, np.linalg.inv(T_WORLD_CAM))], K, SHAPE)
    ids = np.array([0, *range(1, len(things) + 1), 0])
    rgb = np.full((*SHAPE, 3), 128, np.uint8)
    return make_frame(
        rgb=rgb, segmap=ids[sight.index + 1], depth=sight.depth, K=K, T_world_cam=T_WORLD_CAM
    )


def write_scenes(folder: Path, count: int = 1) -> list[Scene]:
    """Scenes 0, 1, ... with all eight, each in other places, and `shapes/` with their meshes."""
    (folder / "shapes").mkdir(parents=True)
    (folder / "scenes").mkdir()
    for name, mesh in MESHES.items():
        mesh.export(folder / "shapes" / f"{name}.ply")
    for number in range(count):
        things, truth = [], []
        for i, name in enumerate(MESHES):
            x, y = SPOTS[(i + 3 * number) % len(SPOTS)]
            yaw = YAWS[name] + number
            T_world_mesh = similarity(1.0, turn_about_z(yaw), np.array([x, y, 0.0]))
            things.append(in_camera(MESHES[name], np.linalg.inv(T_WORLD_CAM) @ T_world_mesh))
            truth.append(
                {
                    "id": i + 1,
                    "mesh_path": f"shapes/{name}.ply",
                    "position": [x, y, 0.0],
                    "orientation": [0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)],
                    "scale": 1.0,
                }
            )
        save_frame(photograph(things), folder / "scenes" / f"{number}.npz")
        (folder / "scenes" / f"{number}.truth.json").write_text(json.dumps(truth))
    return find_scenes(folder / "scenes")
