"""Scenes of eight solids on a table, in files, and a network small enough to learn them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from table_scene import in_camera, photograph, placed

from brrp_cli.evaluation.scenes import Scene, find_scenes
from brrp_cli.frames.npz import save_frame
from brrp_cli.pointsdf.network import NetworkConfig
from brrp_cli.shapes import kinds, solids

MESHES = {
    "ball": solids.ball(0.04),
    "block": solids.box(0.08, 0.08, 0.08),
    "bottle": kinds.bottle(0.035, 0.16, 0.015, 0.03, 0.04),
    "box": solids.box(0.12, 0.05, 0.10),
    "brick": solids.box(0.10, 0.06, 0.04),
    "can": solids.cylinder(0.04, 0.11),
    "tower": solids.box(0.05, 0.06, 0.15),
    "tub": solids.cylinder(0.06, 0.06),
}
YAWS = dict(zip(MESHES, np.linspace(0, 1.2, len(MESHES)), strict=True))
SPOTS = [(x, y) for y in (-0.12, 0.12) for x in (-0.3, -0.1, 0.1, 0.3)]

NETWORK = replace(
    NetworkConfig(),
    points=64,
    centres=(64, 32, 16, 8),
    neighbours=8,
    features=((16, 16), (16, 32), (32, 32), (32, 64)),
    code=64,
    query_code=64,
    hidden=128,
    dropout=0.0,
)


def write_scenes(folder: Path, count: int = 1) -> list[Scene]:
    """Scenes 0, 1, ... with all eight, each in other places, and `shapes/` with their meshes."""
    (folder / "shapes").mkdir(parents=True)
    (folder / "scenes").mkdir()
    for name, mesh in MESHES.items():
        mesh.export(folder / "shapes" / f"{name}.ply")
    for number in range(count):
        things, truth = {}, []
        for i, name in enumerate(MESHES):
            x, y = SPOTS[(i + 3 * number) % len(SPOTS)]
            yaw = YAWS[name] + number
            things[i + 1] = in_camera(MESHES[name], placed(x, y, yaw))
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
