"""A table with a box, a can and a ball, seen by a camera whose every ray is cast exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from brrp_cli.dependencies import import_open3d

WIDTH, HEIGHT = 160, 120
K = np.array([[150.0, 0, 79.5], [0, 150.0, 60.5], [0, 0, 1]])
BOX_SIZE = np.array([0.10, 0.08, 0.12])
CAN_RADIUS, CAN_HEIGHT = 0.035, 0.10
BALL_RADIUS = 0.04
TABLE_HALF = 0.4


@dataclass(frozen=True)
class Scene:
    """World: z up, table at z = 0. ids: 7 box, 250 can, -3 ball; depth of the table and beyond."""

    depth: np.ndarray
    rgb: np.ndarray
    segmap: np.ndarray
    K: np.ndarray
    T_world_cam: np.ndarray
    raycaster: object

    def inside(self, points_cam: np.ndarray) -> np.ndarray:
        """(n,) id of the object that holds the point (camera frame), 0 = none."""
        p = points_cam @ self.T_world_cam[:3, :3].T + self.T_world_cam[:3, 3]
        ids = np.zeros(len(p), int)
        ids[(np.abs(p - [-0.15, 0.0, 0.06]) < BOX_SIZE / 2).all(axis=1)] = 7
        q = p - [0.03, 0.0, 0.05]
        ids[(np.hypot(q[:, 0], q[:, 1]) < CAN_RADIUS) & (np.abs(q[:, 2]) < CAN_HEIGHT / 2)] = 250
        ids[np.linalg.norm(p - [0.17, -0.02, BALL_RADIUS], axis=1) < BALL_RADIUS] = -3
        return ids


def _scene(table: float) -> Scene:
    o3d = import_open3d()
    shapes = o3d.t.geometry.TriangleMesh
    box = shapes.create_box(*BOX_SIZE).translate(np.array([-0.20, -0.04, 0.0]))
    can = shapes.create_cylinder(CAN_RADIUS, CAN_HEIGHT, 200).translate([0.03, 0.0, 0.05])
    ball = shapes.create_sphere(BALL_RADIUS, 100).translate([0.17, -0.02, BALL_RADIUS])
    slab = shapes.create_box(2 * table, 2 * table, 0.02).translate([-table, -table, -0.02])
    wall = shapes.create_box(4, 0.02, 4).translate([-2.0, 1.5, -2.0])
    caster = o3d.t.geometry.RaycastingScene()
    ids = {int(caster.add_triangles(mesh)): name for mesh, name in
           [(box, 7), (can, 250), (ball, -3), (slab, 0), (wall, 0)]}  # fmt: skip

    eye, target = np.array([0.0, -0.55, 0.55]), np.array([0.0, 0.02, 0.03])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T[:3, 3] = eye
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    local = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], axis=-1)
    rays = np.concatenate([np.broadcast_to(eye, local.shape), local @ T[:3, :3].T], axis=-1)
    hit = caster.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))
    depth = hit["t_hit"].numpy()  # the rays' z is 1, so this is depth along z
    names = np.vectorize(lambda i: ids.get(int(i), 0))(hit["geometry_ids"].numpy())
    rgb = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    return Scene(depth, rgb, names, K.copy(), T, caster)


@pytest.fixture(scope="session")
def scene() -> Scene:
    """The whole scene."""
    return _scene(TABLE_HALF)
