"""A bin on a table, and things in it, seen by a camera whose every ray is cast."""

from __future__ import annotations

import numpy as np
import trimesh
from table_scene import in_camera, photograph

from brrp_cli.demo.layout import camera_pose
from brrp_cli.frames.build import make_frame
from brrp_cli.frames.frame import Frame
from brrp_cli.geometry import similarity, turn_about_z
from brrp_cli.shapes import solids

LENGTH, WIDTH, HEIGHT, FLOOR, WALL = 0.36, 0.26, 0.1, 0.006, 0.004
YAW = 0.3
# From 0.8 m, 50 degrees above the table.
T_WORLD_CAM = camera_pose(np.array([0.0, 0.0, 0.03]), 0.8, np.deg2rad(50.0), 0.9)
BIN = 99


def bin_mesh() -> trimesh.Trimesh:
    outer = solids.box(LENGTH + 2 * WALL, WIDTH + 2 * WALL, HEIGHT)
    return solids.difference(outer, solids.moved(solids.box(LENGTH, WIDTH, HEIGHT), z=FLOOR))


def seen(
    *things: trimesh.Trimesh,
    bin: trimesh.Trimesh | None = None,
    T_world_cam: np.ndarray = T_WORLD_CAM,
    noise: float = 0.0,
    without_depth: np.ndarray | None = None,
) -> Frame:
    """A bin, turned by YAW, and things 1, 2, ...; all are placed in its own frame."""
    T_cam_bin = np.linalg.inv(T_world_cam) @ similarity(1.0, turn_about_z(YAW), np.zeros(3))
    meshes = {number: in_camera(thing, T_cam_bin) for number, thing in enumerate(things, start=1)}
    meshes[BIN] = in_camera(bin_mesh() if bin is None else bin, T_cam_bin)
    clean = photograph(meshes, T_world_cam=T_world_cam)
    depth = np.nan_to_num(clean.points[..., 2])
    depth += np.random.default_rng(0).normal(0, 1, depth.shape) * noise * depth**2
    if without_depth is not None:
        depth[without_depth] = 0.0
    segmap = np.where(clean.segmap == BIN, 0, clean.segmap)
    return make_frame(rgb=clean.rgb, segmap=segmap, depth=depth, K=clean.K, T_world_cam=T_world_cam)


def standing(size: tuple[float, float, float], x: float, y: float) -> trimesh.Trimesh:
    """A box on the bin's floor."""
    return solids.moved(solids.box(*size), x=x, y=y, z=FLOOR)
