"""Two things on a table, before a wall or in a shelf, with a sensor's noise."""

from __future__ import annotations

import numpy as np
import trimesh

from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import backproject
from brrp_cli.raycast import look

H, W = 240, 320
K = np.array([[300.0, 0, W / 2], [0, 300.0, H / 2], [0, 0, 1]])
TABLE = trimesh.creation.box((3.0, 3.0, 0.02)).apply_translation([0, 0, -0.01])
YAW = 0.3
THINGS = [
    trimesh.creation.box((0.08, 0.06, 0.1)).apply_translation([0.0, -0.1, 0.05]),
    trimesh.creation.cylinder(0.03, 0.12).apply_translation([0.05, 0.08, 0.06]),
]
# Inside: from back to front (along x), from side to side, from board to board.
DEPTH, WIDTH, HEIGHT, BOARD = 0.3, 0.6, 0.25, 0.02


def turned(mesh: trimesh.Trimesh, yaw: float = YAW) -> trimesh.Trimesh:
    return mesh.apply_transform(trimesh.transformations.rotation_matrix(yaw, [0, 0, 1]))


def wall(behind: float = 0.2) -> trimesh.Trimesh:
    """Square to the line of sight of a camera at `YAW`."""
    return turned(trimesh.creation.box((0.02, 4.0, 1.6)).apply_translation([-behind, 0, 0.8]))


def shelf(yaw: float = YAW) -> list[trimesh.Trimesh]:
    """The lower board, the back, two sides, the upper board, and a floor half a metre beneath."""
    side = (DEPTH, BOARD, HEIGHT)
    boxes = [
        ((DEPTH, WIDTH + 2 * BOARD, BOARD), (0, 0, -BOARD / 2)),
        ((BOARD, WIDTH + 2 * BOARD, HEIGHT), (-(DEPTH + BOARD) / 2, 0, HEIGHT / 2)),
        (side, (0, (WIDTH + BOARD) / 2, HEIGHT / 2)),
        (side, (0, -(WIDTH + BOARD) / 2, HEIGHT / 2)),
        ((DEPTH, WIDTH + 2 * BOARD, BOARD), (0, 0, HEIGHT + BOARD / 2)),
        ((4.0, 4.0, 0.02), (0, 0, -0.51)),
    ]
    return [
        turned(trimesh.creation.box(size).apply_translation(middle), yaw) for size, middle in boxes
    ]


def photograph(meshes, background, elevation=0.15, roll=0.0, distance=0.55) -> Frame:
    """A frame of things, ids 1, 2, ..., and of background, from a camera at `YAW`."""
    T_world_cam = camera_pose(np.array([0.0, 0.0, 0.05]), distance, elevation, YAW)
    rolled = trimesh.transformations.rotation_matrix(roll, [0, 0, 1])
    T_cam_world = np.linalg.inv(T_world_cam @ rolled)
    solid = [mesh.copy().apply_transform(T_cam_world) for mesh in [*meshes, *background]]
    sight = look(solid, K, (H, W))
    rng = np.random.default_rng(0)
    depth = sight.depth * (1 + 0.001 * rng.normal(size=(H, W)))
    ids = np.where((sight.index >= 0) & (sight.index < len(meshes)), sight.index + 1, 0)
    rgb = np.full((H, W, 3), 120, np.uint8)
    rgb[ids > 0] = (180, 60, 50)
    return Frame(rgb, backproject(depth, K), ids.astype(np.int64), K, T_world_cam @ rolled)


def up(frame: Frame) -> np.ndarray:
    """The table's normal, in the camera's frame."""
    return np.linalg.inv(frame.T_world_cam)[:3, :3] @ [0, 0, 1]


def seen(frame: Frame) -> np.ndarray:
    """(n, 3) all points, camera frame."""
    return frame.points[frame.valid].astype(np.float64)
