"""Neighbours and unexplained points that a hand must not touch on its way in.

Rays and corners sort out most hands at once; those that are to be kept are checked exactly, box
against triangles, by FCL (Pan, Chitta, Manocha, "FCL: A general purpose library for collision and
proximity queries", ICRA 2012).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import GraspConfig, SurroundingsConfig
from brrp_cli.dependencies import import_library
from brrp_cli.geometry import grid_nodes
from brrp_cli.grasping.closing import runs_into
from brrp_cli.grasping.draws import Mesh, mesh_alone
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.grasping.hidden_space import HiddenSpace

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Obstacles:
    """What stands around one object: closed meshes and loose points (n, 3), metres, camera frame,
    and the space that nobody sees."""

    meshes: list[Mesh]
    loose: Array
    hidden: HiddenSpace

    def probably_hits(
        self, T_cam_gripper: Array, openings: Array, gripper: Gripper, config: GraspConfig
    ) -> Flags:
        """Which hands (n,) touch something on their way in, as rays tell."""
        found = np.zeros(len(T_cam_gripper), dtype=bool)
        low, high = _reached(T_cam_gripper, openings, gripper, config)
        for mesh in self.meshes:
            lower, upper = mesh.bounds
            near = ~found & ((low <= upper) & (high >= lower)).all(axis=1)
            if near.any():
                alone, T, wide = mesh_alone(mesh), T_cam_gripper[near], openings[near]
                found[near] = runs_into(alone, T, wide, gripper, config, inset=config.inset)[0]
        if len(self.loose):
            found |= _hold_points(self.loose, T_cam_gripper, openings, gripper, config)
        if self.hidden.depth.size:
            boxes = gripper.boxes(openings, config.approach)
            swept = _points_within(boxes, config.surroundings) @ np.swapaxes(
                T_cam_gripper[:, :3, :3], 1, 2
            )
            swept += T_cam_gripper[:, None, :3, 3]
            found |= self.hidden.holds(swept).any(axis=1)
        return found

    def hits(
        self, T_cam_gripper: Array, opening: float, gripper: Gripper, config: GraspConfig
    ) -> bool:
        """Whether one hand touches a mesh on its way in. Errors: DependencyError without
        python-fcl."""
        boxes = gripper.boxes(np.array([opening]), config.approach)[0]
        low, high = _reached(T_cam_gripper[None], np.array([opening]), gripper, config)
        for mesh in self.meshes:
            lower, upper = mesh.bounds
            if (low[0] > upper).any() or (high[0] < lower).any():
                continue
            local = (mesh.vertices - T_cam_gripper[:3, 3]) @ T_cam_gripper[:3, :3]
            if any(_touch(local, mesh.faces, box, config.inset) for box in boxes):
                return True
        return False


def _reached(
    T_cam_gripper: Array, openings: Array, gripper: Gripper, config: GraspConfig
) -> tuple[Array, Array]:
    """Corners (n, 3) of boxes, camera frame, that hold all that a hand sweeps."""
    corners = gripper.corners(openings, config.approach)
    R, t = T_cam_gripper[:, :3, :3], T_cam_gripper[:, :3, 3]
    placed = corners @ np.swapaxes(R, 1, 2) + t[:, None]
    return placed.min(axis=1), placed.max(axis=1)


def _touch(vertices: Array, faces: NDArray[np.int64], box: Array, inset: float) -> bool:
    """Whether triangles touch a box (2, 3), smaller by `inset` on each side, in its own axes."""
    low, high = box[0] + inset, box[1] - inset
    # What lies beyond one side of the box as a whole needs no tree: few triangles are left.
    sides = np.concatenate([vertices < low, vertices > high], axis=1) @ (1 << np.arange(6))
    near = faces[(sides[faces[:, 0]] & sides[faces[:, 1]] & sides[faces[:, 2]]) == 0]
    if not len(near):
        return False
    fcl = import_library("fcl")
    used, local = np.unique(near, return_inverse=True)
    model = fcl.BVHModel()
    model.beginModel(len(used), len(near))
    model.addSubModel(vertices[used], local.reshape(near.shape))
    model.endModel()
    part = fcl.CollisionObject(fcl.Box(*(high - low)), fcl.Transform((low + high) / 2))
    return bool(fcl.collide(part, fcl.CollisionObject(model)))


def _points_within(boxes: Array, config: SurroundingsConfig) -> Array:
    """(n, k, 3) points of boxes (n, b, 2, 3), from end to end."""
    counts = (config.across, config.across, config.along)
    shares = [np.linspace(0, 1, count) for count in counts]
    share = grid_nodes(shares).reshape(-1, 3)
    low, high = boxes[:, :, None, 0], boxes[:, :, None, 1]
    count = boxes.shape[1] * len(share)
    return np.asarray((low + share * (high - low)).reshape(len(boxes), count, 3))


def _hold_points(
    points: Array, T_cam_gripper: Array, openings: Array, gripper: Gripper, config: GraspConfig
) -> Flags:
    """Which hands (n,) sweep a point (k, 3)."""
    boxes = gripper.boxes(openings, config.approach)
    found = np.zeros(len(T_cam_gripper), dtype=bool)
    for i, T in enumerate(T_cam_gripper):
        local = (points - T[:3, 3]) @ T[:3, :3]
        inside = (local[None] >= boxes[i, :, None, 0]) & (local[None] <= boxes[i, :, None, 1])
        found[i] = inside.all(axis=-1).any()
    return found
